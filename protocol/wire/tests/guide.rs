//! The guide shows code that is compiled: each of its Rust blocks names a file and stands in it word for word.

use std::fs;
use std::path::Path;

/// A block of the guide, and the file after `rust` in its first line.
struct Block<'a> {
    file: &'a str,
    lines: Vec<&'a str>,
}

fn blocks(guide: &str) -> Vec<Block<'_>> {
    let mut blocks = Vec::new();
    let mut lines = guide.lines();
    while let Some(line) = lines.next() {
        if let Some(file) = line.strip_prefix("```rust") {
            let lines = lines.by_ref().take_while(|line| *line != "```").collect();
            blocks.push(Block { file: file.trim(), lines });
        }
    }
    blocks
}

/// Whether these lines follow one another in `text`, all of them indented by as much.
fn stands_in(lines: &[&str], text: &str) -> bool {
    let text: Vec<&str> = text.lines().collect();
    text.windows(lines.len()).any(|window| {
        let indent = window[0].len() - window[0].trim_start().len();
        window.iter().zip(lines).all(|(written, shown)| written.get(indent..).unwrap_or_default() == *shown)
    })
}

#[test]
fn every_rust_block_of_the_guide_stands_in_the_file_it_names() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let guide = fs::read_to_string(root.join("docs/guide.md")).unwrap();
    let blocks = blocks(&guide);
    assert!(blocks.len() > 5, "the guide has lost its code");
    for Block { file, lines } in blocks {
        let text = fs::read_to_string(root.join(file));
        let text = text.unwrap_or_else(|error| panic!("a block names the file `{file}`: {error}"));
        assert!(stands_in(&lines, &text), "this is not in {file}:\n{}", lines.join("\n"));
    }
}

#[test]
fn a_block_that_differs_by_a_word_is_found_out() {
    let text = "fn a() {\n    one();\n\n    two();\n}\n";
    assert!(stands_in(&["one();", "", "two();"], text));
    assert!(!stands_in(&["one();", "two();"], text));
    assert!(!stands_in(&["one();", "", "three();"], text));
}
