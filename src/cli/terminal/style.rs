//! What the terminal can show.

use std::env;

use crate::report::text::Style;

/// Unicode where the locale says so (the first of `LC_ALL`, `LC_CTYPE`, `LANG` that is set), ASCII elsewhere.
pub(crate) fn style() -> Style {
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"]
        .iter()
        .find_map(|name| env::var(name).ok().filter(|value| !value.is_empty()))
        .unwrap_or_default()
        .to_ascii_lowercase();
    if locale.contains("utf-8") || locale.contains("utf8") {
        Style::UNICODE
    } else {
        Style::ASCII
    }
}
