//! plotly.js, the part of it that draws lines, dots and bars: `plotly.js-basic-dist-min` 4.1.1 of npm, unchanged, with
//! its licence beside it. It is a quarter of the size of the whole library, which the crate `plotly` carries (1.2 of
//! 4.7 MB): a page opens faster, and nothing else of either is needed.

use std::sync::LazyLock;

const BUNDLE: &str = include_str!("plotly/plotly-basic.min.js");

/// Names of XML vocabularies look like addresses, and are none.
const VOCABULARIES: &str = "http://www.w3.org/";

/// The library, as the content of a script element of a page that refers to no address: those of credits and of
/// services that the page does not use lose their `https://`.
pub(super) fn plotly() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| without_addresses(BUNDLE));
    &TEXT
}

fn without_addresses(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find("http") {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        let scheme = ["https://", "http://"]
            .into_iter()
            .find(|scheme| rest.starts_with(scheme));
        match scheme {
            Some(scheme) if !rest.starts_with(VOCABULARIES) => rest = &rest[scheme.len()..],
            _ => {
                out.push_str("http");
                rest = &rest["http".len()..];
            }
        }
    }
    out.push_str(rest);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vocabularies_stay_and_addresses_go() {
        assert_eq!(
            without_addresses("a https://x.y/z http http://www.w3.org/2000/svg http://q"),
            "a x.y/z http http://www.w3.org/2000/svg q"
        );
        let text = plotly();
        assert!(text.contains("http://www.w3.org/2000/svg"));
        assert!(!text.contains("https://"));
        assert_eq!(
            text.matches("http://").count(),
            text.matches(VOCABULARIES).count()
        );
    }

    #[test]
    fn the_library_can_stand_in_a_script_element() {
        let text = plotly().to_lowercase();
        assert!(!text.contains("</script") && !text.contains("<!--"));
    }
}
