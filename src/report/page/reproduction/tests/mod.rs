//! The page and the CSV of a small reproduction.

use super::super::tests::{is_sound, opens_offline, own};
use super::reproduction_page;
use crate::report::reproduction_csv;
use crate::reproduce::{
    Agreement, BarSeries, Bars, Comparison, Curve, Fact, Figure, Origin, Panel, Quantity,
    REPRODUCTION_FORMAT, Reproduction, Role, Row, Table,
};

fn quantity(label: &str, logarithmic: bool) -> Quantity {
    Quantity {
        label: label.to_owned(),
        unit: String::new(),
        logarithmic,
    }
}

fn small() -> Reproduction {
    let text = |t: &str| t.to_owned();
    Reproduction {
        format: text(REPRODUCTION_FORMAT),
        version: text("0.0.0"),
        experiment: text("example-1"),
        title: text("An <example> & its figure"),
        paper: text("A. Author, A paper"),
        runs: 20,
        paper_runs: 200,
        seed: 7,
        setup: vec![Fact {
            name: text("Samples"),
            value: text("500 +- 1"),
            source: Origin::Paper,
        }],
        comparison: [Agreement::Yes, Agreement::Misprint]
            .map(|agreement| Comparison {
                place: text("Table 1"),
                paper: text("\"quoted\""),
                here: text("1.0 +- 0.1"),
                agreement,
                why: String::new(),
            })
            .to_vec(),
        figures: vec![Figure {
            id: text("figure-1"),
            title: text("Variance"),
            caption: String::new(),
            x: quantity("frequency", true),
            y: quantity("variance", true),
            at: vec![0.01, 0.1, 1.0],
            panels: vec![Panel {
                title: text("panel"),
                curves: vec![
                    Curve {
                        name: text("mean"),
                        role: Role::First,
                        lines: vec![vec![Some(1.0), Some(10.0), Some(100.0)]],
                        band: Some([
                            vec![None, Some(5.0), Some(50.0)],
                            vec![Some(2.0), Some(20.0), Some(200.0)],
                        ]),
                    },
                    Curve {
                        name: text("runs"),
                        role: Role::Runs,
                        lines: vec![vec![Some(1.0), None, Some(3.0)]; 2],
                        band: None,
                    },
                ],
            }],
        }],
        bars: vec![Bars {
            id: text("bars-1"),
            title: text("Relative rms"),
            caption: text("What to see."),
            quantity: text("rms relative to tk-chol"),
            reference: 1.0,
            cut: 3.0,
            groups: vec![text("a1"), text("c1")],
            series: vec![BarSeries {
                name: text("tk"),
                values: vec![Some(1.5), Some(34.0)],
            }],
        }],
        tables: vec![Table {
            id: text("table-1"),
            title: text("Numbers"),
            caption: String::new(),
            rows_are: text("Method"),
            columns: vec![text("a1"), text("c1")],
            rows: vec![Row {
                name: text("tk"),
                values: vec![Some(0.125), None],
                printed: true,
            }],
            digits: 3,
        }],
        remarks: vec![text("A remark.")],
    }
}

#[test]
fn the_page_holds_everything_and_loads_nothing() {
    let page = reproduction_page(&small()).unwrap();
    opens_offline("reproduction", &page);
    is_sound("reproduction", &page);
    let page = own(&page);
    for word in [
        "An &lt;example&gt; &amp; its figure",
        "1.0 ± 0.1",
        "error in print",
        "paper has 200",
        "--runs 20 --seed 7",
        "A remark.",
        "\"logarithmic\":true",
        "\"quiet\":true",
    ] {
        assert!(page.contains(word), "{word}");
    }
    // The bar of 34 is cut at 3 and carries its value.
    assert!(page.contains("\"labels\":[\"\",\"34\"]"));
    assert!(!page.contains("<example>"));
}

#[test]
fn every_number_is_a_row() {
    let text = reproduction_csv(&small()).unwrap();
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    // Three places of one line and of a bundle of two; two bars; two cells.
    assert_eq!(rows.len(), 3 + 6 + 2 + 2);
    let second = &rows[1];
    assert_eq!(&second[3], "mean");
    let numbers: Vec<f64> = (5..9).map(|k| second[k].parse().unwrap()).collect();
    assert_eq!(numbers, [0.1, 10.0, 5.0, 20.0]);
    assert_eq!(&rows[0][7], "");
    assert_eq!(rows[10][6].parse::<f64>().unwrap(), 34.0);
    assert_eq!((&rows[12][3], &rows[12][6]), ("c1", ""));
}
