//! Where in a JSON text something stands, for messages.

/// One step into a document.
#[derive(Debug, Clone, PartialEq)]
enum Step {
    Key(String),
    Index(usize),
}

/// Line and column, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Position {
    pub(crate) line: usize,
    pub(crate) column: usize,
}

/// Byte offset of a position that serde_json reports (its column counts bytes).
pub(crate) fn offset(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum();
    (start + column).min(text.len())
}

/// The path, such as `inputs[1].name`, of the value that is open at `offset`; empty at the top.
pub(crate) fn path_at(text: &str, offset: usize) -> String {
    let mut path = String::new();
    for step in walk(text, offset, &mut |_, _| ()) {
        match step {
            Step::Key(key) if path.is_empty() => path = key,
            Step::Key(key) => {
                path.push('.');
                path.push_str(&key);
            }
            Step::Index(index) => path.push_str(&format!("[{index}]")),
        }
    }
    path
}

/// Where a key of the document itself stands.
pub(crate) fn position_of(text: &str, wanted: &str) -> Option<Position> {
    let mut found = None;
    walk(text, text.len(), &mut |key, at| {
        if key == wanted && found.is_none() {
            found = Some(at);
        }
    });
    found.map(|at| {
        let before = text.get(..at).unwrap_or_default();
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Position {
            line: before.matches('\n').count() + 1,
            column: at - line_start + 1,
        }
    })
}

/// Follows the brackets up to byte `end`; `top_key` is told of the keys of the outermost object.
fn walk(text: &str, end: usize, top_key: &mut dyn FnMut(&str, usize)) -> Vec<Step> {
    let bytes = text.as_bytes();
    let mut steps: Vec<Step> = Vec::new();
    // Whether a string would be a key, for each open bracket.
    let mut expects_key: Vec<bool> = Vec::new();
    let mut at = 0;
    while at < end.min(bytes.len()) {
        match bytes[at] {
            b'{' => {
                steps.push(Step::Key(String::new()));
                expects_key.push(true);
            }
            b'[' => {
                steps.push(Step::Index(0));
                expects_key.push(false);
            }
            b'}' | b']' => {
                steps.pop();
                expects_key.pop();
            }
            b',' => match steps.last_mut() {
                Some(Step::Index(index)) => *index += 1,
                Some(Step::Key(_)) => {
                    if let Some(expects) = expects_key.last_mut() {
                        *expects = true;
                    }
                }
                None => {}
            },
            b'"' => {
                let start = at + 1;
                at = start;
                while at < bytes.len() && bytes[at] != b'"' {
                    at += if bytes[at] == b'\\' { 2 } else { 1 };
                }
                if expects_key.last() == Some(&true) {
                    let key = text.get(start..at.min(bytes.len())).unwrap_or_default();
                    if steps.len() == 1 {
                        top_key(key, start - 1);
                    }
                    if let Some(step) = steps.last_mut() {
                        *step = Step::Key(key.to_owned());
                    }
                    if let Some(expects) = expects_key.last_mut() {
                        *expects = false;
                    }
                }
            }
            _ => {}
        }
        at += 1;
    }
    steps.retain(|step| *step != Step::Key(String::new()));
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "{\n  \"a, {\": [1, 2],\n  \"B\": [[1, 2],\n   [3, x]],\n \"c\": {\"d\": [{\"e\": 1}]}}";

    #[test]
    fn paths_are_followed_through_brackets_and_strings() {
        let at = |what: &str| path_at(TEXT, TEXT.find(what).unwrap());
        assert_eq!(at("x"), "B[1][1]");
        assert_eq!(at("2]"), "a, {[1]");
        assert_eq!(at("1}]"), "c.d[0].e");
        assert_eq!(path_at(TEXT, 0), "");
    }

    #[test]
    fn keys_have_a_place() {
        assert_eq!(
            position_of(TEXT, "B"),
            Some(Position { line: 3, column: 3 })
        );
        assert_eq!(position_of(TEXT, "e"), None);
        assert_eq!(offset(TEXT, 3, 2), TEXT.find("\"B").unwrap());
    }
}
