use innovant::identify::*;
use innovant::log::*;
use std::time::Instant;
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let v: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (v[11].parse::<f64>().unwrap() + v[12].parse::<f64>().unwrap()) / 100.0
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    if a[1] == "gen" {
        innovant::systems::van_wingerden_one()
            .record(a[2].parse().unwrap(), 1)
            .write_csv(std::path::Path::new(&a[3]))
            .unwrap();
        return;
    }
    let mut o = Options {
        past: a[2].parse().ok(),
        ..Default::default()
    };
    if let Some(n) = a.get(3).and_then(|x| x.parse().ok()) {
        o.order = Order::Fixed(n);
    }
    let t = Instant::now();
    let c = cpu();
    let mut r = FileRecords::open(
        vec![Source::from(a[1].as_str())],
        Roles {
            sample_time: None,
            ..Default::default()
        },
    )
    .unwrap();
    let m = identify_records(&mut r, &o).unwrap();
    println!(
        "wall {:?} cpu {:.3}  n={} p={} f={} polished={} iters",
        t.elapsed(),
        cpu() - c,
        m.system.states(),
        m.summary.as_ref().unwrap().horizons.past,
        m.summary.as_ref().unwrap().horizons.future,
        m.summary.as_ref().unwrap().polished
    );
    let s = std::fs::read_to_string("/proc/self/status").unwrap();
    println!("{}", s.lines().find(|l| l.starts_with("VmHWM")).unwrap());
}
