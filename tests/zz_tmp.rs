#![allow(missing_docs)]
use innovant::systems;
#[test]
fn gen_data() {
    std::fs::create_dir_all("/tmp/h4/d").unwrap();
    let shift = |samples, seed| {
        let mut log = systems::servo().record(samples, seed);
        log.inputs[0].name = "voltage".into();
        log.inputs[0].unit = Some("V".into());
        log.outputs[0].name = "speed".into();
        log.outputs[0].unit = Some("rad/s".into());
        log.input_data[0].iter_mut().for_each(|u| *u += 12.0);
        log.output_data[0].iter_mut().for_each(|y| *y += 300.0);
        log
    };
    shift(4000, 1)
        .write_csv("/tmp/h4/d/log.csv".as_ref())
        .unwrap();
    shift(3000, 2)
        .write_csv("/tmp/h4/d/fresh.csv".as_ref())
        .unwrap();
    systems::van_wingerden_one()
        .record(2000, 1)
        .write_csv("/tmp/h4/d/ex1.csv".as_ref())
        .unwrap();
    systems::van_wingerden_one()
        .record(2000, 2)
        .write_csv("/tmp/h4/d/ex1b.csv".as_ref())
        .unwrap();
    systems::two_by_two()
        .record(2000, 1)
        .write_csv("/tmp/h4/d/two.csv".as_ref())
        .unwrap();
    systems::van_wingerden_one()
        .record(1000000, 1)
        .write_csv("/tmp/h4/d/big.csv".as_ref())
        .unwrap();
}
