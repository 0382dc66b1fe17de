//! Reference values.
use innovant::identify::*;
use innovant::log::*;

#[test]
fn look() {
    let log = Log::read(&Source::from("/tmp/ref.csv"), &Roles::default()).unwrap();
    let logs = [log];
    let mut r = MemoryRecords::new(&logs).unwrap();
    let o = Options {
        order: Order::Fixed(4),
        past: Some(10),
        future: Some(10),
        polish: Polish::Never,
        detrend: innovant::moments::Detrend::None,
        ..Default::default()
    };
    let f = fit(&mut r, &o).unwrap();
    println!("{:?}", innovant::linalg::eigenvalues(&f.system.a));
    println!("{}", f.innovation_covariance);
    println!("{:?}", f.summary);
    println!("cov A11 {:e}", f.covariance.matrix[(0, 0)]);
    for o in [
        Options::default(),
        Options {
            detrend: innovant::moments::Detrend::None,
            ..Default::default()
        },
    ] {
        let f = fit(&mut r, &o).unwrap();
        println!("{:?}", innovant::linalg::eigenvalues(&f.system.a));
        println!("{}", f.innovation_covariance);
        println!("{:#?}", f.summary);
    }
}
