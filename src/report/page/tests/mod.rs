//! What holds for every page.

use super::plotly::plotly;

/// The page without the library that draws.
pub(super) fn own(page: &str) -> String {
    assert_eq!(page.matches(plotly()).count(), 1);
    page.replace(plotly(), "")
}

/// Nothing of the page comes from elsewhere, and it is no larger than a page may be.
pub(super) fn opens_offline(name: &str, page: &str) {
    assert!(page.len() < 6_000_000, "{name}: {} bytes", page.len());
    let vocabularies = page.matches("http://www.w3.org/").count();
    assert_eq!(page.matches("http://").count(), vocabularies, "{name}");
    assert!(!page.contains("https://"), "{name}");
    let own = own(page);
    for word in [
        "http:", "//www", " src=", "@import", "url(", "<link", "fetch(",
    ] {
        assert!(!own.contains(word), "{name}: {word}");
    }
    assert!(own.contains("default-src 'none'"));
}

/// Scripts, tables and pictures are what the frame and the data of the pictures have, and say what they are.
pub(super) fn is_sound(name: &str, page: &str) {
    let own = own(page);
    let count = |what: &str| own.matches(what).count();
    assert_eq!(
        (count("<script>"), count("<h1"), count("<main")),
        (2, 1, 1),
        "{name}"
    );
    assert_eq!(
        count("<script"),
        2 + count("<script type=\"application/json\">"),
        "{name}"
    );
    assert_eq!(count("<script"), count("</script>"), "{name}");
    let pictures = count("class=\"drawing\"");
    assert_eq!(
        pictures,
        count("<script type=\"application/json\">"),
        "{name}"
    );
    assert_eq!(pictures, count("role=\"img\""), "{name}");
    // Every picture has a heading and a sentence.
    assert_eq!(count("<h4>"), pictures, "{name}");
    assert_eq!(count("<h4></h4>"), 0, "{name}");
    for part in own.split("class=\"drawing\"").skip(1) {
        let rest = part
            .split_once("<script type=\"application/json\">")
            .unwrap();
        let (caption, data) = (rest.0, rest.1.split("</script>").next().unwrap());
        assert!(
            caption.contains("<p class=\"caption\">"),
            "{name}: {caption}"
        );
        let drawing: serde_json::Value = serde_json::from_str(data).unwrap();
        assert!(drawing["x"]["label"].is_string() && drawing["y"]["unit"].is_string());
        assert!(!drawing["series"].as_array().unwrap().is_empty(), "{name}");
    }
    let mut ids: Vec<&str> = own
        .split(" id=\"")
        .skip(1)
        .filter_map(|s| s.split('"').next())
        .collect();
    let all = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), all, "{name}: ids are unique");
    for target in own.split("href=\"#").skip(1) {
        let id = target.split('"').next().unwrap();
        assert!(ids.contains(&id), "{name}: {id}");
    }
}
