//! Sheets to print, by their geometry; what other people's tools find on them is a test of the whole system.

use skein_positioning::markers::sheet::{Paper, pages, to_pdf};
use skein_positioning::markers::{Dictionary, Grey, Layout, detect};

fn floor(dictionary: &str, columns: u32, rows: u32, side_m: f64) -> Layout {
    let text = format!(
        "dictionary = \"{dictionary}\"\n[[floor]]\nfirst_id = 1\ncolumns = {columns}\nrows = {rows}\nside_m = {side_m}\n\
         pitch_m = 3.0\n"
    );
    toml::from_str(&text).unwrap()
}

/// The rectangles of a page, mm.
fn rectangles(svg: &str) -> Vec<[f64; 4]> {
    let pieces = svg.split('M').skip(1).filter_map(|piece| piece.split_once('z'));
    let numbers = pieces.map(|(piece, _)| {
        let numbers: Vec<f64> =
            piece.split([' ', 'h', 'v', '-']).filter_map(|number| number.parse().ok()).collect();
        [numbers[0], numbers[1], numbers[2], numbers[3]]
    });
    numbers.collect()
}

#[test]
fn our_own_detector_finds_every_marker_of_every_page() {
    for (dictionary, paper) in [("original", "a4"), ("4x4_50", "letter"), ("7x7_50", "300x500")] {
        let layout = floor(dictionary, 5, 3, 0.04);
        let mut found = Vec::new();
        for page in pages(&layout, paper.parse::<Paper>().unwrap()).unwrap() {
            // Two pixels a millimetre.
            let (width, height) = (600, 1000);
            let mut pixels = vec![255; width * height];
            for [left, top, across, down] in rectangles(&page.to_svg()) {
                let pixel = |mm: f64| (mm * 2.0).round() as usize;
                for row in pixel(top)..pixel(top + down) {
                    pixels[row * width..][pixel(left)..pixel(left + across)].fill(0);
                }
            }
            let image = Grey::new(&pixels, width, height).unwrap();
            let mut here: Vec<u32> = detect(&image, layout.dictionary()).iter().map(|seen| seen.id).collect();
            here.sort_unstable();
            assert_eq!(here, page.ids().collect::<Vec<_>>(), "{dictionary}");
            found.extend(here);
        }
        assert_eq!(found, (1..=15).collect::<Vec<_>>(), "{dictionary}");
    }
}

#[test]
fn the_smallest_paper_is_chosen_and_a_marker_that_fits_none_names_one() {
    let paper = |side_m| Paper::for_layout(&floor("original", 1, 1, side_m)).to_string();
    assert_eq!([paper(0.1), paper(0.18), paper(0.3), paper(0.6)], ["a4", "a3", "a2", "a0"]);
    let huge = floor("original", 1, 1, 2.0);
    let refusal = pages(&huge, Paper::for_layout(&huge)).unwrap_err().to_string();
    let named: Paper = refusal.split('`').nth(1).unwrap().parse().unwrap();
    assert_eq!(pages(&huge, named).unwrap().len(), 1, "{refusal}");
}

#[test]
fn a_pdf_has_a_page_for_each_sheet() {
    let pages = pages(&floor("original", 4, 4, 0.08), "a4".parse().unwrap()).unwrap();
    let pdf = to_pdf(&pages);
    let pages_told = pdf.windows(12).filter(|bytes| *bytes == b"/Type /Page\n").count();
    assert!(pdf.starts_with(b"%PDF-1.") && pages.len() > 3);
    assert_eq!(pages_told, pages.len());
}

#[test]
fn every_dictionary_can_be_printed() {
    for name in Dictionary::names() {
        let layout = floor(name, 2, 2, 0.05);
        assert_eq!(pages(&layout, "a4".parse().unwrap()).unwrap().len(), 1, "{name}");
    }
}
