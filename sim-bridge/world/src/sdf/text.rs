//! An XML text and its elements, each of which knows where it stands.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use roxmltree::{Document, Node, TextPos};

use super::error::SdfError;
use super::place::Place;

/// Numbers beyond this are taken for mistakes, m.
const LIMIT_M: f64 = 1e6;
/// Times that a text which is not quite XML is mended.
const MOST_MENDINGS: usize = 8;

/// A text, and where its lines begin.
pub(super) struct Source<'a> {
    name: Arc<str>,
    text: &'a str,
    /// The byte at which each line begins.
    lines: Vec<usize>,
}

impl<'a> Source<'a> {
    pub(super) fn new(name: &str, text: &'a str) -> Self {
        let lines = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { name: name.into(), text, lines }
    }

    /// Runs `read` on the root element.
    pub(super) fn read<R>(
        &self,
        read: impl FnOnce(Element<'_>) -> Result<R, SdfError>,
    ) -> Result<R, SdfError> {
        let mut text = Cow::Borrowed(self.text);
        for _ in 0..MOST_MENDINGS {
            let error = match Document::parse(&text) {
                Ok(document) => {
                    let source = Source { name: self.name.clone(), ..Source::new("", &text) };
                    return read(Element { node: document.root_element(), source: &source });
                }
                Err(error) => error,
            };
            match mended(&text, &error) {
                Some(mended) => text = Cow::Owned(mended),
                None => return Err(self.malformed(&error)),
            }
        }
        Err(SdfError::Malformed {
            place: self.place(0),
            message: format!("more than {MOST_MENDINGS} prefixes are used without a word on what they are"),
            advice: "declare them with xmlns:",
        })
    }

    /// The place where XML stops being XML. An unclosed comment swallows the rest of the file, so the parser
    /// complains about the end; the place to mend is where the comment opens.
    fn malformed(&self, error: &roxmltree::Error) -> SdfError {
        use roxmltree::Error::{NoRootNode, UnclosedRootNode, UnexpectedEndOfStream};
        if let Some(offset) = unclosed_comment(self.text) {
            return SdfError::Malformed {
                place: self.place(offset),
                message: "a comment opens here and never closes".to_owned(),
                advice: "close it with `-->` or delete it",
            };
        }
        let message = error.to_string();
        let message = message.strip_suffix(&format!(" at {}", error.pos())).unwrap_or(&message).to_owned();
        match error {
            NoRootNode | UnclosedRootNode | UnexpectedEndOfStream => SdfError::Malformed {
                place: self.place(self.text.len()),
                message,
                advice: "the file seems to be cut off: close every element, the last one being </sdf>",
            },
            _ => {
                let TextPos { row, col } = error.pos();
                let place = Place { source_name: self.name.clone(), line: row, column: col };
                SdfError::Malformed { place, message, advice: "correct the XML there" }
            }
        }
    }

    fn place(&self, offset: usize) -> Place {
        let line = self.lines.partition_point(|begin| *begin <= offset);
        let begin = self.lines.get(line.saturating_sub(1)).copied().unwrap_or_default();
        let column = self.text.get(begin..offset).map_or(0, |before| before.chars().count()) + 1;
        let number = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        Place { source_name: self.name.clone(), line: number(line), column: number(column) }
    }
}

/// The text without what is no XML but what Gazebo takes: prefixes that nobody has declared, names with `::` in
/// them, comments with `--` in them, a declaration that is not at the beginning.
fn mended(text: &str, error: &roxmltree::Error) -> Option<String> {
    match error {
        roxmltree::Error::UnknownNamespace(prefix, _) => {
            Some(text.replacen("<sdf", &format!("<sdf xmlns:{prefix}=\"{prefix}\""), 1))
        }
        roxmltree::Error::UnexpectedDeclaration(_) => {
            let open = text.find("<?xml")?;
            let length = text.get(open..)?.find("?>")? + 2;
            let (before, after) = (text.get(..open)?, text.get(open + length..)?);
            Some(format!("{before}{}{after}", " ".repeat(length)))
        }
        roxmltree::Error::InvalidName(_) => Some(plain_names(text)).filter(|plain| plain != text),
        roxmltree::Error::InvalidComment(_) => Some(blank_comments(text)).filter(|blank| blank != text),
        _ => None,
    }
}

/// The text with `__` for each `::` in the names of its elements.
fn plain_names(text: &str) -> String {
    let mut pieces = text.split('<');
    let mut plain = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let end = piece.find(|c: char| c.is_whitespace() || c == '>').unwrap_or(piece.len());
        let (name, rest) = piece.split_at(end);
        plain.push('<');
        plain.push_str(&name.replace("::", "__"));
        plain.push_str(rest);
    }
    plain
}

/// The text with nothing but space and ends of lines in its comments.
fn blank_comments(text: &str) -> String {
    let (mut blank, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(open) = rest.find("<!") {
        let (before, from) = rest.split_at(open);
        blank.push_str(before);
        let (head, tail) = if from.starts_with("<!--") { ("<!--", "-->") } else { ("<!", ">") };
        let tail = if from.starts_with("<![CDATA[") { "]]>" } else { tail };
        let content = from.get(head.len()..).unwrap_or_default();
        let Some(length) = content.find(tail) else {
            rest = from;
            break;
        };
        let (content, after) = content.split_at(length);
        blank.push_str(head);
        if head == "<!--" {
            blank.extend(content.bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }));
        } else {
            blank.push_str(content);
        }
        blank.push_str(tail);
        rest = after.get(tail.len()..).unwrap_or_default();
    }
    blank + rest
}

/// Byte offset of a comment that is never closed.
fn unclosed_comment(text: &str) -> Option<usize> {
    let mut from = 0;
    loop {
        let open = from + text.get(from..)?.find("<!--")?;
        match text.get(open..)?.find("-->") {
            Some(close) => from = open + close + 3,
            None => return Some(open),
        }
    }
}

/// An element of a text.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    node: Node<'a, 'a>,
    source: &'a Source<'a>,
}

impl<'a> Element<'a> {
    pub(super) fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    /// The file that it stands in.
    pub(super) fn file(&self) -> &'a str {
        &self.source.name
    }

    pub(super) fn place(&self) -> Place {
        self.source.place(self.node.range().start)
    }

    /// Its name after that of what holds it.
    pub(super) fn path(&self) -> String {
        let above = self.node.parent_element().map_or("", |above| above.tag_name().name());
        if above.is_empty() { self.name().to_owned() } else { format!("{above}/{}", self.name()) }
    }

    /// The text in it, without space around it.
    pub(super) fn text(&self) -> &'a str {
        self.node.text().unwrap_or_default().trim()
    }

    /// An attribute that is not empty.
    pub(super) fn attribute(&self, name: &str) -> Option<&'a str> {
        self.node.attribute(name).map(str::trim).filter(|text| !text.is_empty())
    }

    pub(super) fn elements(&self) -> impl Iterator<Item = Self> + use<'a> {
        let source = self.source;
        self.node.children().filter(Node::is_element).map(move |node| Element { node, source })
    }

    pub(super) fn children(&self, name: &'static str) -> impl Iterator<Item = Self> + use<'a> {
        self.elements().filter(move |child| child.name() == name)
    }

    pub(super) fn child(&self, name: &'static str) -> Option<Self> {
        self.children(name).next()
    }

    /// The text in a child.
    pub(super) fn child_text(&self, name: &'static str) -> Option<&'a str> {
        self.child(name).map(|child| child.text())
    }

    /// Whether a child says yes; `None` without that child.
    pub(super) fn flag(&self, name: &'static str) -> Option<bool> {
        self.child_text(name).map(|text| matches!(text, "1" | "true" | "True"))
    }

    pub(super) fn required(&self, name: &'static str, expected: &'static str) -> Result<Self, SdfError> {
        self.child(name).ok_or_else(|| self.lacks(expected))
    }

    pub(super) fn lacks(&self, expected: &'static str) -> SdfError {
        SdfError::Missing { place: self.place(), element: self.name().to_owned(), expected }
    }

    pub(super) fn bad_value(&self, expected: &'static str) -> SdfError {
        let found = self.text().chars().take(80).collect();
        SdfError::Value { place: self.place(), element: self.name().to_owned(), found, expected }
    }

    /// Exactly `N` numbers of sensible magnitude.
    pub(super) fn numbers<const N: usize>(&self, expected: &'static str) -> Result<[f64; N], SdfError> {
        let mut numbers = [0.0; N];
        let mut words = self.text().split_whitespace();
        for number in &mut numbers {
            *number = words
                .next()
                .and_then(|word| word.parse().ok())
                .filter(|number: &f64| number.abs() <= LIMIT_M)
                .ok_or_else(|| self.bad_value(expected))?;
        }
        if words.next().is_some() { Err(self.bad_value(expected)) } else { Ok(numbers) }
    }

    /// The numbers in a child; `None` without that child.
    pub(super) fn child_numbers<const N: usize>(
        &self,
        name: &'static str,
        expected: &'static str,
    ) -> Result<Option<[f64; N]>, SdfError> {
        self.child(name).map(|child| child.numbers(expected)).transpose()
    }

    /// The sizes in a child, all above 0.
    pub(super) fn sizes<const N: usize>(
        &self,
        name: &'static str,
        expected: &'static str,
    ) -> Result<[f64; N], SdfError> {
        let child = self.required(name, expected)?;
        let sizes = child.numbers::<N>(expected)?;
        if sizes.iter().any(|size| *size <= 0.0) { Err(child.bad_value(expected)) } else { Ok(sizes) }
    }

    pub(super) fn size(&self, name: &'static str) -> Result<f64, SdfError> {
        self.sizes::<1>(name, "a size above 0").map(|[size]| size)
    }

    /// The pose that is written in it; the identity where nothing is.
    pub(super) fn isometry(&self) -> Result<Isometry3<f64>, SdfError> {
        if self.text().is_empty() {
            return Ok(Isometry3::identity());
        }
        if self.attribute("rotation_format") == Some("quat_xyzw") {
            let [x, y, z, qx, qy, qz, qw] = self.numbers("x y z and a quaternion x y z w")?;
            let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), 1e-9)
                .ok_or_else(|| self.bad_value("a quaternion that is not zero"))?;
            return Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation));
        }
        let [x, y, z, mut roll, mut pitch, mut yaw] = self.numbers("six numbers: x y z roll pitch yaw")?;
        if matches!(self.attribute("degrees"), Some("1" | "true")) {
            (roll, pitch, yaw) = (roll.to_radians(), pitch.to_radians(), yaw.to_radians());
        }
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
    }
}
