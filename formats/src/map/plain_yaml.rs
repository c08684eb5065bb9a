//! The YAML that Autoware writes beside its maps: scalars, one level of nesting, and lists in one
//! line. Anchors, tags, quotes that span lines and whatever else YAML can do are refused, so that
//! reading takes linear time and no more memory than the file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// A file of 10,000 tiles has some 300 KB.
const MAX_BYTES: u64 = 16 * 1024 * 1024;

/// What stands behind a key.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Text(String),
    List(Vec<String>),
    Map(BTreeMap<String, Value>),
}

impl Value {
    pub(super) fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    /// A number that is finite.
    pub(super) fn number(&self) -> Option<f64> {
        let number: f64 = self.text()?.parse().ok()?;
        number.is_finite().then_some(number)
    }

    pub(super) fn at(&self, key: &str) -> Option<&Self> {
        match self {
            Self::Map(map) => map.get(key),
            _ => None,
        }
    }
}

/// Reads a file.
pub(super) fn read(file: &Path) -> Result<BTreeMap<String, Value>, String> {
    let mut text = String::new();
    let opened = File::open(file).map_err(|error| error.to_string())?;
    let taken = opened.take(MAX_BYTES + 1).read_to_string(&mut text);
    taken.map_err(|error| error.to_string())?;
    match text.len() as u64 > MAX_BYTES {
        true => Err(format!("it has over {MAX_BYTES} bytes")),
        false => parse(&text),
    }
}

/// Reads a text.
pub(super) fn parse(text: &str) -> Result<BTreeMap<String, Value>, String> {
    let mut map = BTreeMap::new();
    let mut outer: Option<String> = None;
    for (line, number) in text.lines().zip(1..) {
        let wrong = |why: &str| format!("line {number}: {why}");
        let said = without_comment(line);
        if said.trim().is_empty() || said.trim() == "---" {
            continue;
        }
        let (key, value) = pair(said).ok_or_else(|| wrong("it is no `key: value`"))?;
        let is_nested = said.starts_with([' ', '\t']);
        let target = match (&outer, is_nested) {
            (Some(outer), true) => match map.get_mut(outer) {
                Some(Value::Map(nested)) => nested,
                _ => return Err(wrong("it is nested in what is no mapping")),
            },
            (None, true) => return Err(wrong("it is nested in nothing")),
            (_, false) => &mut map,
        };
        let is_mapping = value.is_empty() && !is_nested;
        let value = if is_mapping {
            Value::Map(BTreeMap::new())
        } else {
            scalar(value).map_err(|why| wrong(&why))?
        };
        if target.insert(key.clone(), value).is_some() {
            return Err(wrong(&format!("the key {key:?} appears twice")));
        }
        if !is_nested {
            outer = is_mapping.then_some(key);
        }
    }
    Ok(map)
}

/// A `#` begins a comment at the start of a line or behind a blank.
fn without_comment(line: &str) -> &str {
    let begins = |at: &usize| *at == 0 || line[..*at].ends_with([' ', '\t']);
    let comment = line.match_indices('#').map(|(at, _)| at).find(begins);
    comment.map_or(line, |at| &line[..at])
}

fn pair(said: &str) -> Option<(String, &str)> {
    let said = said.trim();
    let (key, value) = match said.split_once(": ") {
        Some((key, value)) => (key, value.trim()),
        None => (said.strip_suffix(':')?, ""),
    };
    let key = unquoted(key.trim());
    (!key.is_empty()).then(|| (key.to_owned(), value))
}

fn scalar(text: &str) -> Result<Value, String> {
    if let Some(list) = text.strip_prefix('[') {
        let list = list
            .strip_suffix(']')
            .ok_or("its list does not end in its line")?;
        let items = list.split(',').map(|item| unquoted(item.trim()).to_owned());
        return Ok(Value::List(items.collect()));
    }
    match text.starts_with(['&', '*', '!', '|', '>', '{', '%', '@', '`']) {
        true => Err(format!(
            "{:?} is YAML that is not read here",
            text.chars().take(20).collect::<String>()
        )),
        false => Ok(Value::Text(unquoted(text).to_owned())),
    }
}

fn unquoted(text: &str) -> &str {
    let within = |quote| text.strip_prefix(quote)?.strip_suffix(quote);
    within('"').or_else(|| within('\'')).unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_autoware_writes() {
        let text = "# map\nprojector_type: MGRS\nmgrs_grid: '54SUE' # square\nmap_origin:\n  \
                    latitude: 35.5\n  longitude: -1e2\n\nx_resolution: 100.0\n\"0_0.osm\": [0, -100.0]\n";
        let map = parse(text).unwrap();
        assert_eq!(map["projector_type"].text(), Some("MGRS"));
        assert_eq!(map["mgrs_grid"].text(), Some("54SUE"));
        assert_eq!(
            map["map_origin"].at("longitude").unwrap().number(),
            Some(-100.0)
        );
        assert_eq!(
            map["0_0.osm"],
            Value::List(vec!["0".to_owned(), "-100.0".to_owned()])
        );
    }

    #[test]
    fn what_is_not_read_is_refused_by_its_line() {
        for (text, line) in [
            ("a: 1\nb", "line 2"),
            ("  a: 1", "line 1"),
            ("a: 1\n  b: 2", "line 2"),
            ("a: &x 1", "line 1"),
            ("a: *x", "line 1"),
            ("a: [1,", "line 1"),
            ("a: 1\na: 2", "line 2"),
            ("a: nan\nc: |", "line 2"),
        ] {
            assert!(parse(text).unwrap_err().starts_with(line), "{text:?}");
        }
        assert_eq!(parse("a: nan").unwrap()["a"].number(), None);
    }
}
