//! Sizes of the boards' programs in docs/boards.md are those of the programs, to a hundredth: the names of source files
//! in a program depend on where it is built.

use host_tests::bare_metal::{BOARDS, build};
use libtest_mimic::{Failed, Trial};
use object::{Object, ObjectSegment};

/// Largest difference from a published size, as a part of it.
const MARGIN: f64 = 0.01;

/// The tests of this file, by name.
pub fn trials() -> Vec<Trial> {
    vec![Trial::test("the_programs_take_of_their_memories_what_is_published", published)]
}

/// Bytes of flash, RAM and CCM SRAM, as `.ci/size` counts them.
fn taken(program: &[u8]) -> Result<[u64; 3], object::Error> {
    let mut taken = [0; 3];
    for segment in object::File::parse(program)?.segments() {
        taken[0] += segment.file_range().1;
        match segment.address() {
            0x1000_0000..0x2000_0000 => taken[2] += segment.size(),
            0x2000_0000..0x4000_0000 => taken[1] += segment.size(),
            _ => {}
        }
    }
    Ok(taken)
}

/// The first number of a cell, "117,992 B of 116 KiB".
fn first_number(cell: &str) -> Option<u64> {
    cell.split(" B").next()?.trim().replace(',', "").parse().ok()
}

fn published() -> Result<(), Failed> {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/boards.md"))?;
    let mut wrong = Vec::new();
    for (column, board) in BOARDS.iter().enumerate() {
        let program = build(board.name, env!("CARGO_TARGET_TMPDIR"))?;
        let taken = taken(&std::fs::read(program)?)?;
        for (row, taken) in ["| flash, without", "| RAM, with", "| CCM SRAM"].into_iter().zip(taken) {
            let line = page.lines().find(|line| line.starts_with(row)).ok_or(row)?;
            let cell = line.split(" | ").nth(1 + column).ok_or(row)?;
            let published = first_number(cell).ok_or_else(|| format!("no number in {cell}"))?;
            if (taken as f64 / published as f64 - 1.0).abs() > MARGIN {
                wrong.push(format!("{}: {row}: {taken} B, published {published} B", board.name));
            }
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n").into()) }
}
