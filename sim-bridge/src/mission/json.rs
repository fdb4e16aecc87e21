//! Values of a JSON document that know where they stand, so that an error names file, line and field.

use serde_json::Value;

use super::{MissionError, Warning};

/// A JSON document with the text it came from, comments blanked out.
pub struct Document<'a> {
    file: &'a str,
    text: String,
    root: Value,
}

impl<'a> Document<'a> {
    /// Parses `text`, in which a `#` outside of strings starts a comment; `file` is what errors call it.
    pub fn parse(text: &str, file: &'a str) -> Result<Self, MissionError> {
        let text = without_comments(text);
        match serde_json::from_str(&text) {
            Ok(root) => Ok(Self { file, text, root }),
            Err(error) => {
                let full = error.to_string();
                // The message ends with the position, which the error states on its own.
                let message = full.split(" at line ").next().unwrap_or(&full).to_owned();
                Err(MissionError::Syntax {
                    file: file.to_owned(),
                    line: error.line(),
                    column: error.column(),
                    message,
                })
            }
        }
    }

    /// The outermost value.
    pub fn root(&self) -> Node<'_> {
        Node { document: self, value: &self.root, path: Vec::new() }
    }

    /// The document's name in errors.
    pub fn file(&self) -> &str {
        self.file
    }
}

/// A value and its path from the root.
#[derive(Clone)]
pub struct Node<'a> {
    document: &'a Document<'a>,
    value: &'a Value,
    path: Vec<Step<'a>>,
}

#[derive(Clone, Copy, PartialEq)]
enum Step<'a> {
    Member(&'a str),
    Element(usize),
}

impl<'a> Node<'a> {
    /// The member of that name, where there is one that is not null.
    pub fn optional(&self, name: &'a str) -> Option<Node<'a>> {
        let value = self.value.get(name).filter(|v| !v.is_null())?;
        Some(self.below(value, Step::Member(name)))
    }

    pub fn member(&self, name: &'a str) -> Result<Node<'a>, MissionError> {
        self.optional(name).ok_or_else(|| {
            let expected = format!("a member `{name}`");
            match self.value {
                Value::Object(_) => self.error(expected, "none"),
                _ => self.mismatch(expected),
            }
        })
    }

    /// The elements of an array.
    pub fn elements(&self) -> Result<Vec<Node<'a>>, MissionError> {
        let array = self.value.as_array().ok_or_else(|| self.mismatch("an array"))?;
        Ok(array.iter().enumerate().map(|(i, value)| self.below(value, Step::Element(i))).collect())
    }

    /// The number of elements of an array.
    pub fn count(&self) -> Result<usize, MissionError> {
        self.value.as_array().map(Vec::len).ok_or_else(|| self.mismatch("an array"))
    }

    /// An element of an array, where there is one.
    pub fn element(&self, index: usize) -> Option<Node<'a>> {
        let value = self.value.as_array()?.get(index)?;
        Some(self.below(value, Step::Element(index)))
    }

    /// The lines of the elements of an array, in one walk through the text.
    pub fn element_lines(&self) -> Vec<usize> {
        let scanner = Scanner { rest: self.document.text.as_bytes(), line: 1 };
        scanner.at(&self.path).map(Scanner::element_lines).unwrap_or_default()
    }

    /// The members of an object, in alphabetical order; nulls too.
    pub fn members(&self) -> Vec<(&'a str, Node<'a>)> {
        let members = self.value.as_object().into_iter().flatten();
        members.map(|(name, value)| (name.as_str(), self.below(value, Step::Member(name)))).collect()
    }

    /// A number. JSON knows no infinities, so it is finite.
    pub fn number(&self) -> Result<f64, MissionError> {
        self.value.as_f64().ok_or_else(|| self.mismatch("a number"))
    }

    /// A number in a closed range.
    pub fn number_in(&self, from: f64, to: f64, unit: &str) -> Result<f64, MissionError> {
        let number = self.number()?;
        if (from..=to).contains(&number) {
            return Ok(number);
        }
        Err(self.mismatch(format!("a number from {from} to {to} {unit}")))
    }

    /// A whole number of at least 0.
    pub fn whole_number(&self) -> Result<u64, MissionError> {
        self.value.as_u64().ok_or_else(|| self.mismatch("a whole number"))
    }

    /// True or false.
    pub fn truth(&self) -> Result<bool, MissionError> {
        self.value.as_bool().ok_or_else(|| self.mismatch("true or false"))
    }

    pub fn text(&self) -> Result<&'a str, MissionError> {
        self.value.as_str().ok_or_else(|| self.mismatch("a string"))
    }

    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], MissionError> {
        let numbers = self.elements()?.iter().map(Node::number).collect::<Result<Vec<_>, _>>()?;
        let length = numbers.len();
        numbers.try_into().map_err(|_| self.error(format!("{N} numbers"), format!("{length}")))
    }

    pub fn is_null(&self) -> bool {
        self.value.is_null()
    }

    /// It is an array or object without content.
    pub fn is_empty(&self) -> bool {
        match self.value {
            Value::Array(array) => array.is_empty(),
            Value::Object(object) => object.is_empty(),
            _ => false,
        }
    }

    /// An error that says what was expected and shows the value.
    pub fn mismatch(&self, expected: impl Into<String>) -> MissionError {
        let found = match self.value {
            Value::Array(array) => format!("an array of {}", array.len()),
            Value::Object(_) => "an object".to_owned(),
            other => other.to_string(),
        };
        self.error(expected, found)
    }

    /// An error at this value.
    pub fn error(&self, expected: impl Into<String>, found: impl Into<String>) -> MissionError {
        MissionError::Field {
            file: self.document.file.to_owned(),
            line: self.line(),
            field: self.field(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// A warning at this value.
    pub fn warning(&self, message: impl std::fmt::Display) -> Warning {
        let message = format!("{}: {message}", self.field());
        Warning { file: self.document.file.to_owned(), line: self.line(), message }
    }

    /// Path as in `mission.items[3]`; `document` for the root.
    fn field(&self) -> String {
        let mut field = String::new();
        for step in &self.path {
            match step {
                Step::Member(name) if field.is_empty() => field.push_str(name),
                Step::Member(name) => field.extend([".", name]),
                Step::Element(index) => field.push_str(&format!("[{index}]")),
            }
        }
        if field.is_empty() { "document".to_owned() } else { field }
    }

    /// The document's name in errors.
    pub fn file(&self) -> &'a str {
        self.document.file
    }

    /// Line from 1.
    pub fn line(&self) -> usize {
        Scanner { rest: self.document.text.as_bytes(), line: 1 }.find(&self.path)
    }

    fn below(&self, value: &'a Value, step: Step<'a>) -> Node<'a> {
        let mut path = self.path.clone();
        path.push(step);
        Node { document: self.document, value, path }
    }
}

/// Blanks out `#` comments; every other character keeps its place.
fn without_comments(text: &str) -> String {
    let (mut in_string, mut escaped, mut in_comment) = (false, false, false);
    let blank = |c: char| {
        if in_comment {
            in_comment = c != '\n';
            return if in_comment { ' ' } else { c };
        }
        match c {
            '#' if !in_string => {
                in_comment = true;
                return ' ';
            }
            '"' if !escaped => in_string = !in_string,
            _ => {}
        }
        escaped = in_string && c == '\\' && !escaped;
        c
    };
    text.chars().map(blank).collect()
}

/// Walks over JSON text that is known to be well-formed, counting lines.
struct Scanner<'t> {
    rest: &'t [u8],
    line: usize,
}

impl Scanner<'_> {
    /// The line of the value at `path`, or of the innermost value on the way that exists.
    fn find(self, path: &[Step<'_>]) -> usize {
        match self.walk(path) {
            Ok(at) => at.line,
            Err(line) => line,
        }
    }

    /// A scanner at the value at `path`, if there is one.
    fn at(self, path: &[Step<'_>]) -> Option<Self> {
        self.walk(path).ok()
    }

    /// The line of each element of the array that begins here.
    fn element_lines(mut self) -> Vec<usize> {
        let mut lines = Vec::new();
        self.take();
        loop {
            self.skip_blanks();
            match self.rest.first() {
                Some(b',') => {
                    self.take();
                }
                None | Some(b']' | b'}') => return lines,
                _ => {
                    lines.push(self.line);
                    self.skip_value();
                }
            }
        }
    }

    /// Goes to the value at `path`; the line of the innermost value on the way if there is none.
    fn walk(mut self, path: &[Step<'_>]) -> Result<Self, usize> {
        self.skip_blanks();
        let Some((step, below)) = path.split_first() else { return Ok(self) };
        let line = self.line;
        let mut index = 0;
        self.take();
        loop {
            self.skip_blanks();
            match self.rest.first() {
                Some(b',') => {
                    self.take();
                    continue;
                }
                None | Some(b']' | b'}') => return Err(line),
                _ => {}
            }
            let found = match *step {
                Step::Member(name) => {
                    let key = self.skip_string() == name.as_bytes();
                    self.skip_blanks();
                    self.take();
                    key
                }
                Step::Element(wanted) => wanted == index,
            };
            if found {
                return self.walk(below);
            }
            index += 1;
            self.skip_value();
        }
    }

    fn take(&mut self) -> Option<u8> {
        let (&byte, rest) = self.rest.split_first()?;
        self.rest = rest;
        self.line += usize::from(byte == b'\n');
        Some(byte)
    }

    fn skip_blanks(&mut self) {
        while self.rest.first().is_some_and(u8::is_ascii_whitespace) {
            self.take();
        }
    }

    /// Skips a string and returns what stands between its quotes.
    fn skip_string(&mut self) -> &[u8] {
        self.take();
        let text = self.rest;
        let mut length = 0;
        while let Some(byte) = self.take() {
            match byte {
                b'"' => break,
                b'\\' => length += 1 + usize::from(self.take().is_some()),
                _ => length += 1,
            }
        }
        text.get(..length).unwrap_or_default()
    }

    fn skip_value(&mut self) {
        self.skip_blanks();
        let mut depth = 0_usize;
        loop {
            match self.rest.first() {
                None => return,
                Some(b'"') => {
                    self.skip_string();
                }
                Some(b'[' | b'{') => {
                    depth += 1;
                    self.take();
                }
                Some(b']' | b'}') if depth > 0 => {
                    depth -= 1;
                    self.take();
                }
                Some(b',' | b']' | b'}') if depth == 0 => return,
                Some(_) => {
                    self.take();
                    continue;
                }
            }
            if depth == 0 {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "{\n \"a\": [1, # a comment with \" and ]\n  {\"b\\\"c\": \"x,]}#\",\n   \"d\": [true,\n  -2.5e3]}],\n \"e\": null\n}";

    fn line(path: &[Step<'_>]) -> usize {
        let text = without_comments(TEXT);
        Scanner { rest: text.as_bytes(), line: 1 }.find(path)
    }

    #[test]
    fn every_value_is_found_on_its_line() {
        use Step::{Element, Member};
        assert_eq!(line(&[]), 1);
        assert_eq!(line(&[Member("a")]), 2);
        assert_eq!(line(&[Member("a"), Element(1)]), 3);
        assert_eq!(line(&[Member("a"), Element(1), Member("d"), Element(0)]), 4);
        assert_eq!(line(&[Member("a"), Element(1), Member("d"), Element(1)]), 5);
        assert_eq!(line(&[Member("e")]), 6);
    }

    #[test]
    fn a_missing_value_is_on_the_line_of_what_should_hold_it() {
        assert_eq!(line(&[Step::Member("a"), Step::Element(1), Step::Member("none")]), 3);
        assert_eq!(line(&[Step::Member("a"), Step::Element(7)]), 2);
    }

    #[test]
    fn a_comment_ends_with_its_line_and_does_not_start_in_a_string() -> Result<(), MissionError> {
        let document = Document::parse(TEXT, "t.json")?;
        let second = document.root().member("a")?.elements()?.remove(1);
        assert_eq!(second.member("b\"c")?.text()?, "x,]}#");
        Ok(())
    }

    #[test]
    fn an_error_names_file_line_field_expectation_and_value() -> Result<(), MissionError> {
        let document = Document::parse(TEXT, "t.json")?;
        let flag = document.root().member("a")?.elements()?.remove(1).member("d")?.elements()?.remove(0);
        let error = flag.number().expect_err("true is no number").to_string();
        assert_eq!(error, "t.json:4: field `a[1].d[0]`: expected a number, found true");
        Ok(())
    }
}
