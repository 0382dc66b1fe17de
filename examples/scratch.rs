use innovant::explain::{Simulation, scratch};
use innovant::log::{Log, RoleNeed, Roles, Source};
use std::path::Path;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let folder = Path::new(&args[1]);
    let only: Vec<usize> = args.get(2).map(|s| s.split(',').map(|x| x.parse().unwrap()).collect()).unwrap_or_default();
    let mut i = 0;
    loop {
        let case = folder.join(format!("case_{i:03}"));
        if !case.exists() { break; }
        let me = i; i += 1;
        if !only.is_empty() && !only.contains(&me) { continue; }
        let truth: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(folder.join(format!("truth/case_{me:03}.json"))).unwrap()).unwrap();
        let log = Log::read(&Source::from(case.join("recording.csv")), &Roles::default()).unwrap();
        let json = case.join("simulation.json");
        let sim = if json.exists() {
            Simulation::Model(Box::new(innovant::report::read_model(&json).unwrap().model))
        } else {
            let roles = Roles::default();
            let _ = RoleNeed::Identify;
            Simulation::Outputs(vec![read_outputs(&case.join("simulation.csv"), &roles, &log)])
        };
        let t = std::time::Instant::now();
        println!("== {me} {} {} er {:.3} nr {} col {} pe {} known {}", truth["plant"], truth["effects"], truth["effect_ratio"].as_f64().unwrap_or(0.0), truth["noise_ratio"], truth["noise_colour"], truth["parameter_error"], truth["known_to_simulation"]);
        match scratch(&[log], &sim) { Some(lines) => for l in lines { println!("   {l}"); }, None => println!("   NONE") }
        println!("   {:.2} s", t.elapsed().as_secs_f64());
    }
}
fn read_outputs(p: &Path, _roles: &Roles, log: &Log) -> Log {
    let text = std::fs::read_to_string(p).unwrap();
    let mut lines = text.lines();
    let n = lines.next().unwrap().split(',').count() - 1;
    let mut cols = vec![Vec::new(); n];
    for l in lines { for (c, v) in cols.iter_mut().zip(l.split(',').skip(1)) { c.push(v.parse().unwrap()); } }
    Log::from_columns("sim", log.sample_time, vec![], log.outputs.clone(), vec![], cols).unwrap()
}
