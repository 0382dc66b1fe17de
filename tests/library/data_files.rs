//! The recordings of `data/` are what their notes say: simulated by the test systems of the library.

#[test]
fn recordings_are_those_of_the_test_systems() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    for (name, made) in crate::data::recordings() {
        let stored = std::fs::read_to_string(folder.join(name)).unwrap();
        // Compared as numbers: the last decimal may differ where the machine's mathematics does.
        assert_eq!(stored.lines().count(), made.lines().count(), "{name}");
        assert_eq!(stored.lines().next(), made.lines().next(), "{name}");
        for (number, (a, b)) in stored.lines().zip(made.lines()).enumerate().skip(1) {
            for (x, y) in a.split(',').zip(b.split(',')) {
                let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
                assert!(
                    (x - y).abs() <= 1.1e-4 * x.abs().max(1.0),
                    "{name} line {}",
                    number + 1
                );
            }
        }
        let note = folder.join(name.replace("_check", "").replace(".csv", ".md"));
        assert!(note.exists(), "{} is missing", note.display());
    }
}
