//! The source of a scene: its text, followed by its `--set` options. Every value has a position in it, so
//! that a message can point at the line or option of a mistake.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use toml_parser::lexer::TokenKind;

use crate::error::Error;
use crate::math::digits::short;

/// Deepest nesting of brackets and braces, and most words of a key. A scene needs three.
const DEEPEST: usize = 32;

/// Byte range in the source.
pub(super) type Span = std::ops::Range<usize>;

/// The source of a scene: name, text and `--set` options.
pub(super) struct Source<'a> {
    /// Path of the scene as the user typed it.
    name: &'a str,
    sets: &'a [String],
    /// The text of the scene, then each `--set` on a line of its own.
    all: String,
    /// Position in `all` at which each `--set` starts.
    starts: Vec<usize>,
    /// From a dotted path to the positions of its key and of its value.
    spans: HashMap<String, (Span, Span)>,
}

/// A `--set` option, split and ready to be merged.
pub(super) struct SetDocument {
    words: Vec<Spanned<String>>,
    /// Position of VALUE in the source.
    value: Span,
    /// `v=VALUE`, after blanks that put VALUE at its position in the source; `None` if VALUE is not TOML.
    document: Option<String>,
    raw: String,
}

impl<'a> Source<'a> {
    pub fn new(name: &'a str, text: &str, sets: &'a [String]) -> Self {
        let mut all = text.to_owned();
        let mut starts = Vec::new();
        for set in sets {
            all.push('\n');
            starts.push(all.len());
            all.push_str(set);
        }
        Source { name, sets, all, starts, spans: HashMap::new() }
    }

    /// Splits each `--set` into the words of its key, and its value.
    pub fn set_documents(&self) -> Result<Vec<SetDocument>, Error> {
        self.sets.iter().zip(&self.starts).map(|(set, &start)| set_document(set, start)).collect()
    }

    /// The table of the scene, with all `--set` options merged into it in order.
    ///
    /// A later value replaces an earlier one. Tables are merged key by key, and missing tables are created.
    pub fn merged<'i>(&self, text: &'i str, sets: &'i [SetDocument]) -> Result<Spanned<DeTable<'i>>, Error> {
        if let Some(span) = too_deep(text) {
            let message = format!(
                "not valid TOML: it is nested more than {DEEPEST} deep: a bracket must be closed by its own \
                 kind, and a key is made of a few words"
            );
            return Err(self.error(Some(span), &message));
        }
        let mut table = DeTable::parse(text).map_err(|mistake| {
            let why = mistake.message();
            self.error(mistake.span(), &format!("not valid TOML: {why}{}", hint(why)))
        })?;
        for set in sets {
            put(table.get_mut(), &set.words, set.parsed()).map_err(|depth| {
                let above =
                    set.words[..=depth].iter().map(|word| word.get_ref().as_str()).collect::<Vec<_>>();
                let (above, below) = (brief(&above.join(".")), brief(set.words[depth + 1].get_ref()));
                let message = format!(
                    "{above} is not a table in the scene and has no key {below}: --set {above}=VALUE \
                     replaces it as a whole"
                );
                self.error(Some(set.words[0].span()), &message)
            })?;
        }
        Ok(table)
    }

    /// Stores the positions of a key and its value.
    pub fn remember(&mut self, path: &str, key: Span, value: Span) {
        self.spans.insert(path.to_owned(), (key, value));
    }

    /// Position of the value of `path`, if it was given.
    pub fn value(&self, path: &str) -> Option<Span> {
        self.spans.get(path).map(|(_, value)| value.clone())
    }

    /// Position of the key of `path`, if it was given.
    pub fn key(&self, path: &str) -> Option<Span> {
        self.spans.get(path).map(|(key, _)| key.clone())
    }

    /// The value at `span` as the user wrote it, shortened.
    pub fn written(&self, span: &Span) -> String {
        brief(self.all.get(span.clone()).unwrap_or_default())
    }

    /// `path = value unit` as the user wrote it, or with the default if the user left it out.
    pub fn assignment(&self, path: &str, default: f64, unit: &str) -> String {
        match self.value(path) {
            Some(span) => format!("{path} = {} {unit}", self.written(&span)),
            None => format!("{path} = {} {unit} (the default)", short(default)),
        }
    }

    /// An error with `message` after the file and line of `span`, or after its `--set`.
    ///
    /// For a file, the line is quoted after the message.
    pub fn error(&self, span: Option<Span>, message: &str) -> Error {
        let Some(span) = span else { return Error::Input(format!("{}: {message}", self.name)) };
        let set = self.starts.iter().rposition(|&start| start <= span.start);
        Error::Input(match set {
            Some(set) => format!("--set {}: {message}", brief(&self.sets[set])),
            None => {
                let text = &self.all[..self.starts.first().map_or(self.all.len(), |&start| start - 1)];
                let (line, excerpt) = excerpt(text, &span);
                format!("{}:{line}: {message}{excerpt}", self.name)
            }
        })
    }
}

impl SetDocument {
    fn parsed(&self) -> Spanned<DeValue<'_>> {
        let toml = self.document.as_deref().and_then(single_value);
        toml.unwrap_or_else(|| Spanned::new(self.value.clone(), DeValue::String(Cow::Borrowed(&self.raw))))
    }
}

fn set_document(set: &str, start: usize) -> Result<SetDocument, Error> {
    let wrong = |why: &str| {
        let set = brief(set);
        Error::Input(format!("--set {set}: {why}: it must be KEY=VALUE, e.g. --set solver.tolerance=1e-3"))
    };
    let (key, value) = set.split_once('=').ok_or_else(|| wrong("there is no = in it"))?;
    if key.trim().is_empty() {
        return Err(wrong("there is no key before the ="));
    }
    let mut words = Vec::new();
    let mut offset = start;
    for word in key.split('.') {
        let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let trimmed = word.trim();
        if trimmed.is_empty() || !trimmed.chars().all(bare) {
            return Err(wrong(&format!(
                "{:?} is not a key, which is made of words with dots between them",
                brief(key)
            )));
        }
        words.push(Spanned::new(offset..offset + word.len(), trimmed.to_owned()));
        offset += word.len() + 1;
    }
    if words.len() > DEEPEST || too_deep(value).is_some() {
        return Err(wrong(&format!("it is nested more than {DEEPEST} deep")));
    }
    // `offset` is now after the `=`, and at least two bytes come before VALUE: a letter and the `=`.
    let document = format!("{}v={value}", " ".repeat(offset - 2));
    let document = single_value(&document).is_some().then_some(document);
    Ok(SetDocument { words, value: offset..offset + value.len(), document, raw: value.trim().to_owned() })
}

/// What would be right where the parser complains with `why`, to be put behind it.
fn hint(why: &str) -> &'static str {
    let hints = [
        ("duplicate key", ": each key and each [table] may stand there once"),
        ("string values must be quoted", ": a number must stand without a unit, and text in quotes"),
        (
            "unexpected key or value",
            ": decimals must follow a point, and numbers of a list stand in brackets",
        ),
        ("key with no value", ": a line must be KEY = VALUE, and a key has no blanks"),
        ("invalid key-value pair", ": a line must be KEY = VALUE or [TABLE]"),
        ("invalid basic string", ": text must end with the quote that it begins with"),
        ("invalid boolean", ": it must be true or false, in lower case"),
    ];
    hints.iter().find(|(start, _)| why.starts_with(start)).map_or("", |(_, hint)| hint)
}

/// The bracket, brace or dot at which a text is nested too deep to be parsed; `None` if there is none.
///
/// The parser recurses once for each level. Its own bound counts stray closing brackets wrongly (toml_parser
/// 1.1.5), so that the stack can overflow.
///
/// Here a bracket closes a level only if it matches the last open one, so the parser is never deeper.
fn too_deep(text: &str) -> Option<Span> {
    let (mut open, mut dots) = (Vec::new(), 0);
    for token in toml_parser::Source::new(text).lex() {
        match token.kind() {
            kind @ (TokenKind::LeftSquareBracket | TokenKind::LeftCurlyBracket) => open.push(kind),
            TokenKind::RightSquareBracket => drop(open.pop_if(|top| *top == TokenKind::LeftSquareBracket)),
            TokenKind::RightCurlyBracket => drop(open.pop_if(|top| *top == TokenKind::LeftCurlyBracket)),
            TokenKind::Dot => dots += 1,
            TokenKind::Newline | TokenKind::Equals | TokenKind::Comma => dots = 0,
            _ => {}
        }
        if open.len() > DEEPEST || dots >= DEEPEST {
            return Some(token.span().start()..token.span().end());
        }
    }
    None
}

/// The value of the key `v` in a valid document that has no other key.
fn single_value(document: &str) -> Option<Spanned<DeValue<'_>>> {
    let mut table = DeTable::parse(document).ok()?.into_inner();
    if table.len() != 1 {
        return None;
    }
    table.remove("v")
}

/// Puts `value` at the path `words`. Fails with the index of the first word that names something else than a
/// table.
fn put<'i>(
    table: &mut DeTable<'i>,
    words: &'i [Spanned<String>],
    value: Spanned<DeValue<'i>>,
) -> Result<(), usize> {
    let Some((word, rest)) = words.split_first() else { return Ok(()) };
    let key = || Spanned::new(word.span(), Cow::Borrowed(word.get_ref().as_str()));
    if rest.is_empty() {
        merge(table, key(), value);
        return Ok(());
    }
    let inner = table
        .entry(key())
        .or_insert_with(|| Spanned::new(word.span(), DeValue::Table(DeTable::new())))
        .get_mut();
    match inner {
        DeValue::Table(inner) => put(inner, rest, value).map_err(|depth| depth + 1),
        _ => Err(0),
    }
}

fn merge<'i>(table: &mut DeTable<'i>, key: Spanned<Cow<'i, str>>, value: Spanned<DeValue<'i>>) {
    let span = value.span();
    match (table.get_mut(key.get_ref().as_ref()).map(Spanned::get_mut), value.into_inner()) {
        (Some(DeValue::Table(old)), DeValue::Table(new)) => {
            for (key, value) in new {
                merge(old, key, value);
            }
        }
        (_, value) => {
            // Remove the entry first: it would keep its old key, and with it the old position.
            table.remove(key.get_ref().as_ref());
            table.insert(key, Spanned::new(span, value));
        }
    }
}

/// The number (from 1) of the line where `span` starts, and that line with the span underlined.
fn excerpt(text: &str, span: &Span) -> (usize, String) {
    let start = char_boundary(text, span.start);
    let line_start = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
    let line_end = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
    let number = text[..start].matches('\n').count() + 1;
    let line = &text[line_start..line_end];
    const WIDEST: usize = 200;
    if line.trim().is_empty() || line.chars().count() > WIDEST {
        return (number, String::new());
    }
    let printable = |c: char| if c.is_control() { ' ' } else { c };
    let shown: String = line.trim_end().chars().map(printable).collect();
    let end = char_boundary(text, span.end.clamp(start, line_end));
    let before = " ".repeat(text[line_start..start].chars().count());
    let marks = "^".repeat(text[start..end].trim_end().chars().count().max(1));
    let gutter = " ".repeat(number.to_string().len());
    (number, format!("\n{gutter} |\n{number} | {shown}\n{gutter} | {before}{marks}"))
}

/// Position of the last start of a character at or before `byte`.
fn char_boundary(text: &str, byte: usize) -> usize {
    (0..=byte.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

/// `text` on one line, without control characters, and shortened if it is long.
pub(crate) fn brief(text: &str) -> String {
    const LONGEST: usize = 60;
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut printable = words.chars().filter(|c| !c.is_control());
    let mut short: String = printable.by_ref().take(LONGEST).collect();
    if printable.next().is_some() {
        short.push_str("...");
    }
    short
}

/// A path as text on one line; only its end if it is very long.
pub(crate) fn shown(path: &Path) -> String {
    const LONGEST: usize = 300;
    let printable = |c: char| if c.is_control() { ' ' } else { c };
    let text: Vec<char> = path.to_string_lossy().chars().map(printable).collect();
    match text.len() {
        0..=LONGEST => text.into_iter().collect(),
        length => "...".chars().chain(text.into_iter().skip(length - LONGEST)).collect(),
    }
}

/// Splits a list of TOML values at the commas outside brackets, braces and quotes.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::split_values;
///
/// assert_eq!(split_values("0.1,[0, 0, -9.81],'a,b'"), ["0.1", "[0, 0, -9.81]", "'a,b'"]);
/// ```
pub fn split_values(list: &str) -> Vec<String> {
    let (mut parts, mut depth, mut quote) = (vec![String::new()], 0i32, None);
    for c in list.chars() {
        match (quote, c) {
            (None, ',') if depth == 0 => {
                parts.push(String::new());
                continue;
            }
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth -= 1,
            (None, '\'' | '"') => quote = Some(c),
            (Some(open), _) if open == c => quote = None,
            _ => {}
        }
        if let Some(part) = parts.last_mut() {
            part.push(c);
        }
    }
    parts.into_iter().map(|part| part.trim().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    fn read(text: &str, sets: &[&str]) -> Result<toml::Table, Error> {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        let source = Source::new("a.toml", text, &sets);
        let documents = source.set_documents()?;
        let merged = source.merged(text, &documents)?;
        Ok(toml::Table::deserialize(toml::Deserializer::from(merged)).unwrap())
    }

    #[test]
    fn a_set_replaces_values_merges_tables_and_creates_missing_ones() {
        let text = "a = 1\n[t]\nb = 2\nc = [1, 2]\n";
        let sets = ["a=3", "t.c=[9]", "t={d = 4}", "new.table.key = 'x'", "t.d=5"];
        let expected = "a = 3\n[t]\nb = 2\nc = [9]\nd = 5\n[new.table]\nkey = 'x'";
        assert_eq!(read(text, &sets).unwrap(), expected.parse().unwrap());
    }

    #[test]
    fn text_that_is_not_toml_is_a_string() {
        let value = |set: &str| read("", &[set]).unwrap()["k"].clone();
        for (set, text) in [
            ("k=start.csv", "start.csv"),
            ("k=a = b", "a = b"),
            ("k=", ""),
            ("k=1\nl=2", "1\nl=2"),
            ("k='x'", "x"),
            ("k=1e-3x", "1e-3x"),
            ("k=\u{e4}.csv", "\u{e4}.csv"),
        ] {
            assert_eq!(value(set), toml::Value::String(text.to_owned()), "{set}");
        }
        assert_eq!(value("k= 7 "), toml::Value::Integer(7));
        assert_eq!(value("k=inf"), toml::Value::Float(f64::INFINITY));
    }

    #[test]
    fn positions_lie_in_the_line_or_the_set_of_the_value() {
        let sets = ["t.b=22".to_owned(), "t.c=word".to_owned()];
        let text = "a = 1\n[t]\nb = 2";
        let source = Source::new("a.toml", text, &sets);
        let documents = source.set_documents().unwrap();
        let merged = source.merged(text, &documents).unwrap().into_inner();
        let table = merged.get("t").unwrap().get_ref().as_table().unwrap();
        assert_eq!(source.written(&merged.get("a").unwrap().span()), "1");
        assert_eq!(source.written(&table.get("b").unwrap().span()), "22");
        assert_eq!(source.written(&table.get("c").unwrap().span()), "word");
        let message = |span| source.error(Some(span), "wrong").to_string();
        assert_eq!(message(table.get("b").unwrap().span()), "--set t.b=22: wrong");
        assert_eq!(message(4..5), "a.toml:1: wrong\n  |\n1 | a = 1\n  |     ^");
        assert_eq!(message(6..99), "a.toml:2: wrong\n  |\n2 | [t]\n  | ^^^");
        assert_eq!(message(15..15), "a.toml:3: wrong\n  |\n3 | b = 2\n  |      ^");
    }

    #[test]
    fn a_set_cannot_change_a_part_of_a_value() {
        let message = read("a = 1", &["a.b.c=2"]).unwrap_err().to_string();
        assert!(
            message.starts_with("--set a.b.c=2: a is not a table in the scene and has no key b"),
            "{message}"
        );
    }
}
