//! Sheets to print: the markers of a layout in their true size, on paper.
//!
//! Around each marker stays white paper, a cell wide: detectors look for the black square on white.

use std::fmt::{self, Write as _};
use std::str::FromStr;

use pdf_writer::{Content, Finish as _, Name, Pdf, Rect, Ref, Str};
use thiserror::Error;

use super::dictionary::Dictionary;
use super::layout::Layout;

/// Paper to print on, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paper {
    width: f64,
    height: f64,
}

/// Papers by name, mm.
const PAPERS: [(&str, f64, f64); 6] = [
    ("a4", 210.0, 297.0),
    ("a3", 297.0, 420.0),
    ("a2", 420.0, 594.0),
    ("a1", 594.0, 841.0),
    ("a0", 841.0, 1189.0),
    ("letter", 215.9, 279.4),
];
/// Sides of a paper, mm: up to the roll of a wide printer.
const PAPER_SIDES: std::ops::RangeInclusive<f64> = 50.0..=5000.0;
/// The edge that printers leave white, mm.
const EDGE: f64 = 6.0;
/// The line of text below a marker, mm.
const TEXT: f64 = 3.0;
/// From the marker's white edge to the line of text and from there on, mm.
const GAP: f64 = 1.5;
/// The line that shows whether a printer keeps to the size, mm.
const RULER: f64 = 100.0;
/// A millimetre in PDF's units.
const POINT: f64 = 72.0 / 25.4;
/// More markers are taken for a mistake.
const MOST: usize = 10_000;

/// This is no paper.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "there is no paper `{0}`: expected a4, a3, a2, a1, a0, letter, or WIDTHxHEIGHT in mm, 50 to 5000 each"
)]
pub struct NoPaper(String);

/// The layout's markers cannot be printed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Unprintable {
    #[error(
        "marker {id} takes {needs:.0} x {tall:.0} mm with its white edge and label; the paper has room for {width:.0} x \
         {height:.0} mm: choose a larger one, such as `{}x{}`", (needs + 2.0 * EDGE).ceil(), (tall + RULER_ROOM + 2.0 * EDGE).ceil()
    )]
    TooLarge { id: u32, needs: f64, tall: f64, width: f64, height: f64 },
    #[error("the layout has {0} markers; at most {MOST} are printed at once")]
    TooMany(usize),
}

/// The room of the ruler at the foot of a page, mm.
const RULER_ROOM: f64 = 2.0 * GAP + TEXT;

impl FromStr for Paper {
    type Err = NoPaper;

    fn from_str(text: &str) -> Result<Self, NoPaper> {
        let lower = text.to_lowercase();
        if let Some((_, width, height)) = PAPERS.into_iter().find(|(name, ..)| *name == lower) {
            return Ok(Self { width, height });
        }
        let side = |text: &str| text.trim().parse().ok().filter(|side| PAPER_SIDES.contains(side));
        let sides =
            lower.trim_end_matches("mm").split_once('x').map(|(width, height)| (side(width), side(height)));
        match sides {
            Some((Some(width), Some(height))) => Ok(Self { width, height }),
            _ => Err(NoPaper(text.to_owned())),
        }
    }
}

impl Paper {
    /// The smallest paper of a name, A4 to A0, that every marker of the layout fits; A0 if none does.
    pub fn for_layout(layout: &Layout) -> Self {
        let [papers @ .., _] = PAPERS.map(|(_, width, height)| Self { width, height });
        let fits = papers.iter().find(|paper| pages(layout, **paper).is_ok());
        fits.copied().unwrap_or(papers[papers.len() - 1])
    }
}

impl fmt::Display for Paper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height } = *self;
        match PAPERS.iter().find(|(_, w, h)| (*w, *h) == (width, height)) {
            Some((name, ..)) => f.write_str(name),
            None => write!(f, "{width}x{height} mm"),
        }
    }
}

/// A page of markers.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    paper: Paper,
    dictionary: String,
    markers: Vec<Printed>,
}

/// A marker on a page. Lengths in mm, from the page's upper left, down.
#[derive(Clone, Debug, PartialEq)]
struct Printed {
    id: u32,
    left: f64,
    top: f64,
    side: f64,
    /// Its black cells as runs: left, top, width and height, in cells.
    black: Vec<[u32; 4]>,
    cell: f64,
}

/// Pages for all markers of a layout in the order of their ids, as many on each as fit.
///
/// # Errors
/// A marker does not fit the paper, or there are too many.
pub fn pages(layout: &Layout, paper: Paper) -> Result<Vec<Page>, Unprintable> {
    let count = layout.markers().count();
    if count > MOST {
        return Err(Unprintable::TooMany(count));
    }
    let (width, height) = (paper.width - 2.0 * EDGE, paper.height - 2.0 * EDGE - RULER_ROOM);
    let dictionary = layout.dictionary();
    let page = || Page { paper, dictionary: dictionary.name().to_owned(), markers: Vec::new() };
    let mut pages = Vec::new();
    let (mut left, mut top, mut row) = (0.0, 0.0, 0.0_f64);
    let mut open = page();
    for placed in layout.markers() {
        let side = placed.side_m * 1000.0;
        let cell = side / dictionary.cells() as f64;
        let (needs, tall) = (side + 2.0 * cell, side + 2.0 * cell + 2.0 * GAP + TEXT);
        if needs > width || tall > height {
            return Err(Unprintable::TooLarge { id: placed.id, needs, tall, width, height });
        }
        if left + needs > width {
            (left, top, row) = (0.0, top + row, 0.0);
        }
        if top + tall > height {
            pages.push(std::mem::replace(&mut open, page()));
            (left, top, row) = (0.0, 0.0, 0.0);
        }
        let black = black_cells(dictionary, placed.id);
        let at = (EDGE + left + cell, EDGE + top + cell);
        open.markers.push(Printed { id: placed.id, left: at.0, top: at.1, side, black, cell });
        (left, row) = (left + needs, row.max(tall));
    }
    if !open.markers.is_empty() {
        pages.push(open);
    }
    Ok(pages)
}

/// The black cells of a marker row by row, those beside one another as one.
fn black_cells(dictionary: &Dictionary, id: u32) -> Vec<[u32; 4]> {
    let cells = dictionary.cells();
    let mut runs = Vec::new();
    for row in 0..cells {
        let is_black = |column: &usize| dictionary.is_white(id, row, *column) == Some(false);
        let mut column = 0;
        while column < cells {
            let length = (column..cells).take_while(is_black).count();
            if length > 0 {
                // A marker has nine cells along a side at most.
                runs.push([column, row, length, 1].map(|number| number as u32));
            }
            column += length.max(1);
        }
    }
    runs
}

impl Printed {
    /// Its black rectangles: left, top, width and height, mm.
    fn rectangles(&self) -> impl Iterator<Item = [f64; 4]> + '_ {
        self.black.iter().map(|run| {
            let [left, top, width, height] = run.map(|cells| f64::from(cells) * self.cell);
            [self.left + left, self.top + top, width, height]
        })
    }

    fn label(&self, dictionary: &str) -> String {
        format!("{dictionary} {}, side {} mm, this side down", self.id, (self.side * 100.0).round() / 100.0)
    }

    /// The left end of the label's foot, mm.
    fn label_at(&self) -> [f64; 2] {
        [self.left, self.top + self.side + self.cell + GAP + TEXT]
    }
}

impl Page {
    /// The ids on it, in order.
    pub fn ids(&self) -> impl Iterator<Item = u32> + '_ {
        self.markers.iter().map(|printed| printed.id)
    }

    /// The line at its foot and its ends, and the words beside it, mm.
    fn ruler(&self) -> ([[f64; 4]; 3], [f64; 2], String) {
        let (left, foot) = (EDGE, self.paper.height - EDGE);
        let length = RULER.min(self.paper.width - 2.0 * EDGE).floor();
        let thin = 0.3;
        let lines = [
            [left, foot - thin, length, thin],
            [left, foot - TEXT, thin, TEXT],
            [left + length - thin, foot - TEXT, thin, TEXT],
        ];
        let words = format!("{length} mm: print at 100 %, and measure this");
        (lines, [left + 2.0 * thin, foot - GAP], words)
    }

    /// The page as an SVG image of the paper's size.
    pub fn to_svg(&self) -> String {
        let Paper { width, height } = self.paper;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" \
             viewBox=\"0 0 {width} {height}\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
        );
        let mut path = |rectangles: &mut dyn Iterator<Item = [f64; 4]>| {
            svg.push_str("<path d=\"");
            for [left, top, width, height] in rectangles {
                let _ = write!(svg, "M{left:.4} {top:.4}h{width:.4}v{height:.4}h-{width:.4}z");
            }
            svg.push_str("\"/>\n");
        };
        let (lines, words_at, words) = self.ruler();
        self.markers.iter().for_each(|printed| path(&mut printed.rectangles()));
        path(&mut lines.into_iter());
        let labels = self.markers.iter().map(|printed| (printed.label_at(), printed.label(&self.dictionary)));
        for ([left, foot], text) in labels.chain([(words_at, words)]) {
            let _ = writeln!(
                svg,
                "<text x=\"{left:.2}\" y=\"{foot:.2}\" font-family=\"sans-serif\" font-size=\"{TEXT}\">{text}</text>"
            );
        }
        svg + "</svg>\n"
    }

    fn to_content(&self) -> Content {
        let mut content = Content::new();
        let up = |top: f64| ((self.paper.height - top) * POINT) as f32;
        let across = |left: f64| (left * POINT) as f32;
        let (lines, words_at, words) = self.ruler();
        let rectangles = self.markers.iter().map(|printed| printed.rectangles().collect::<Vec<_>>());
        for part in rectangles.chain([lines.to_vec()]) {
            for [left, top, width, height] in part {
                content.rect(across(left), up(top + height), across(width), (height * POINT) as f32);
            }
            content.fill_nonzero();
        }
        let labels = self.markers.iter().map(|printed| (printed.label_at(), printed.label(&self.dictionary)));
        for ([left, foot], text) in labels.chain([(words_at, words)]) {
            content.begin_text();
            content.set_font(Name(FONT), across(TEXT));
            content.next_line(across(left), up(foot));
            content.show(Str(text.as_bytes()));
            content.end_text();
        }
        content
    }
}

/// The name of the labels' font within a page.
const FONT: &[u8] = b"F1";

/// All pages as one PDF file.
pub fn to_pdf(pages: &[Page]) -> Vec<u8> {
    let mut pdf = Pdf::new();
    let (catalogue, tree, font) = (Ref::new(1), Ref::new(2), Ref::new(3));
    let numbers = |index: usize| {
        let first = 4 + 2 * i32::try_from(index).unwrap_or(i32::MAX / 4);
        (Ref::new(first), Ref::new(first + 1))
    };
    pdf.catalog(catalogue).pages(tree);
    let count = i32::try_from(pages.len()).unwrap_or(i32::MAX);
    pdf.pages(tree).kids((0..pages.len()).map(|index| numbers(index).0)).count(count);
    pdf.type1_font(font).base_font(Name(b"Helvetica"));
    for (index, page) in pages.iter().enumerate() {
        let (number, content) = numbers(index);
        let [width, height] = [page.paper.width, page.paper.height].map(|side| (side * POINT) as f32);
        let mut written = pdf.page(number);
        written.media_box(Rect::new(0.0, 0.0, width, height)).parent(tree).contents(content);
        written.resources().fonts().pair(Name(FONT), font);
        written.finish();
        pdf.stream(content, &page.to_content().finish());
    }
    pdf.finish()
}
