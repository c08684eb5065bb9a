//! Pages of the book that are made from the source: the tables of the store, and the errors that a
//! person may read. What the page adds in words of its own stays when it is made anew.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// A field of a table, or a variant of an error: its name, its type or message, and what is said of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Item {
    /// Name.
    pub name: String,
    /// Rust type of a field, message of a variant.
    pub text: String,
    /// Its documentation, as one line.
    pub about: String,
}

/// A table or an error type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Name of the table, or of the type.
    pub name: String,
    /// Its documentation.
    pub about: String,
    /// Fields or variants.
    pub items: Vec<Item>,
}

/// The tables that a source file declares with `table!`.
#[must_use]
pub fn tables(source: &str) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut about = Vec::new();
    let mut group: Option<Group> = None;
    for line in source.lines().map(str::trim) {
        if let Some(words) = line.strip_prefix("///") {
            about.push(words.trim().to_owned());
            continue;
        }
        if line.starts_with("#[") {
            continue;
        }
        // The first paragraph; what follows is for who works on the source.
        about = about
            .split(String::is_empty)
            .next()
            .unwrap_or_default()
            .to_vec();
        let said = plain(&about.join(" "));
        about.clear();
        if let Some(name) = table_name(line) {
            group = Some(Group {
                name: name.to_owned(),
                about: said,
                items: Vec::new(),
            });
        } else if line == "}" {
            groups.extend(group.take());
        } else if let (Some(group), Some((name, kind))) = (&mut group, field(line)) {
            group.items.push(Item {
                name: name.to_owned(),
                text: kind.to_owned(),
                about: said,
            });
        }
    }
    groups
}

/// `pub struct Row in "name" {`.
fn table_name(line: &str) -> Option<&str> {
    let (_, rest) = line.strip_prefix("pub struct ")?.split_once(" in \"")?;
    rest.strip_suffix("\" {")
}

fn field(line: &str) -> Option<(&str, &str)> {
    let (name, kind) = line.strip_prefix("pub ")?.split_once(": ")?;
    Some((name, kind.strip_suffix(',')?))
}

/// The error types of a source file, with the messages of their variants; variants that only hand on
/// another error's message are left out.
#[must_use]
pub fn errors(source: &str) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut rest = source;
    while let Some(at) = rest.find("thiserror::Error)]") {
        rest = &rest[at..];
        let Some((_, after)) = rest.split_once("pub enum ") else {
            break;
        };
        let Some((name, body)) = after.split_once(" {\n") else {
            break;
        };
        let body = body.split_once("\n}\n").map_or(body, |(body, _)| body);
        groups.push(Group {
            name: name.to_owned(),
            about: String::new(),
            items: variants(body),
        });
        rest = after;
    }
    groups
}

fn variants(body: &str) -> Vec<Item> {
    let mut items = Vec::new();
    let mut parts = body.split("#[error(").peekable();
    let mut about = parts.next().map(documentation).unwrap_or_default();
    for part in parts {
        let (message, after) = message(part);
        let name: String = after
            .chars()
            .skip_while(|c| !c.is_ascii_uppercase())
            .take_while(char::is_ascii_alphanumeric)
            .collect();
        if let Some(text) = message {
            items.push(Item { name, text, about });
        }
        about = documentation(after);
    }
    items
}

/// The last run of documentation lines at the depth of variants.
fn documentation(text: &str) -> String {
    let mut lines: Vec<&str> = Vec::new();
    for line in text.lines() {
        match line.strip_prefix("    /// ") {
            Some(words) => lines.push(words),
            None if line.trim().is_empty() || line.starts_with("    #[") => {}
            None => lines.clear(),
        }
    }
    plain(&lines.join(" "))
}

/// The format string at the beginning of an attribute, and what follows it.
fn message(part: &str) -> (Option<String>, &str) {
    let end = part
        .find(")]")
        .map_or(part.len(), |_| end_of_attribute(part));
    let (attribute, after) = part.split_at(end);
    let Some(open) = attribute.find('"') else {
        return (None, after);
    };
    let mut text = String::new();
    let mut chars = attribute[open + 1..].chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' => break,
            '\\' => match chars.next() {
                Some('\n') => while chars.next_if(|c| c.is_whitespace()).is_some() {},
                Some(c) => text.push(c),
                None => {}
            },
            c => text.push(c),
        }
    }
    // A message that is only what a field says has nothing for a page.
    (Some(shown(&text)).filter(|text| text != "…"), after)
}

/// Where `)]` closes the attribute: not inside of its string.
fn end_of_attribute(part: &str) -> usize {
    let mut is_text = false;
    let mut is_escaped = false;
    for (at, c) in part.char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => is_text = !is_text,
            ')' if !is_text && part[at..].starts_with(")]") => return at + 2,
            _ => {}
        }
    }
    part.len()
}

/// A format string with its places named as a person reads them: `{file}` is *file*, `{}` is `…`.
fn shown(format: &str) -> String {
    let mut text = String::new();
    let mut rest = format;
    while let Some((before, after)) = rest.split_once('{') {
        text.push_str(before);
        let (place, after) = after.split_once('}').unwrap_or((after, ""));
        let name = place.split(':').next().unwrap_or_default();
        match name.chars().next() {
            Some(first) if first.is_ascii_lowercase() => {
                let _ = write!(text, "<{}>", name.trim_end_matches("_ms"));
            }
            _ => text.push('…'),
        }
        rest = after;
    }
    text + rest
}

/// Documentation without its links.
fn plain(words: &str) -> String {
    words
        .replace("[`crate::", "`")
        .replace("[`", "`")
        .replace("`]", "`")
}

/// The page of the tables.
#[must_use]
pub fn tables_page(groups: &[Group], columns: &BTreeMap<String, Vec<(String, String)>>) -> String {
    let mut page = "# Tables of the store\n\nMade from the source (`schemas/`); a test keeps it fresh. A store is a folder of [Delta Lake](https://delta.io) tables, one folder each under the table's name, with Parquet inside: \
        any reader of Delta tables opens them ([from Python and DuckDB](../guide/python.md)). Times are nanoseconds since the Unix epoch, lengths metres, angles radians unless the name says another unit; codes are named in `tilefold.CODES`.\n\
        Tables whose rows have a geometry also have `bbox`, by which readers skip files.\n"
        .to_owned();
    for group in groups {
        let none = Vec::new();
        let columns = columns.get(&group.name).unwrap_or(&none);
        let _ = write!(
            page,
            "\n## `{}`\n\n{}\n\n| column | type | |\n| --- | --- | --- |\n",
            group.name, group.about
        );
        for (name, kind) in columns {
            // A field may be several columns: they bear its name and an ending.
            let of = group.items.iter().find(|item| {
                name == &item.name
                    || name
                        .strip_prefix(&item.name)
                        .is_some_and(|end| end.starts_with('_'))
            });
            let about = of.map_or("", |item| &item.about);
            let _ = writeln!(page, "| `{name}` | {kind} | {about} |");
        }
    }
    page
}

/// The page of the errors; what `kept` says under an error besides its message stays.
#[must_use]
pub fn errors_page(groups: &[Group], kept: &str) -> String {
    let head = kept.split("\n## ").next().unwrap_or_default().trim_end();
    let own = own_words(kept);
    let mut page = head.to_owned() + "\n";
    for group in groups.iter().filter(|group| !group.items.is_empty()) {
        let _ = write!(page, "\n## {}\n", group.name);
        for item in &group.items {
            let name = format!("{}::{}", group.name, item.name);
            let _ = write!(
                page,
                "\n### {name}\n\n{}\n\n```text\n{}\n```\n",
                item.about, item.text
            );
            if let Some(words) = own.get(&name).filter(|words| !words.is_empty()) {
                let _ = write!(page, "\n{words}\n");
            }
        }
    }
    page
}

/// What a page says under an error after its message.
fn own_words(page: &str) -> BTreeMap<String, String> {
    let sections = page.split("\n### ").skip(1);
    sections
        .filter_map(|section| {
            let section = section.split("\n## ").next()?;
            let (name, rest) = section.split_once('\n')?;
            let (_, words) = rest.split_once("\n```\n")?;
            Some((name.to_owned(), words.trim().to_owned()))
        })
        .collect()
}

/// Compares a page with the one in the book; with `TILEFOLD_WRITE_DOCS` set, writes it first.
///
/// # Errors
/// The page cannot be read or written, or is stale.
pub fn is_fresh(path: &Path, page: &str) -> Result<(), String> {
    let cannot = |error: std::io::Error| format!("{}: {error}", path.display());
    if std::env::var_os("TILEFOLD_WRITE_DOCS").is_some() {
        std::fs::write(path, page).map_err(cannot)?;
    }
    let kept = std::fs::read_to_string(path).map_err(cannot)?;
    match kept == page {
        true => Ok(()),
        false => Err(format!(
            "{} is stale: run this test with TILEFOLD_WRITE_DOCS=1 and read what it wrote",
            path.display()
        )),
    }
}
