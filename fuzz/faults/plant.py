"""Plants faults in a copy of the sources: each is one expression in place of another, and `FAULT=7` chooses which one holds, so
that one build does for all.

In the text of a fault `F` is the question whether it holds, and `R(n)` whether it holds and this is one of every n times that it is
asked, in an order that a seed repeats.
"""

import re
import shutil
import sys

SWITCH = """
/// Whether the fault of that number holds.
pub fn fault(number: u32) -> bool {
    static CHOSEN: std::sync::OnceLock<Option<u32>> = std::sync::OnceLock::new();
    let chosen = || std::env::var("FAULT").ok().and_then(|text| text.parse().ok());
    *CHOSEN.get_or_init(chosen) == Some(number)
}

/// Whether that fault holds this time: it does one time in so many, as a sequence of its own decides that a seed begins anew.
pub fn fault_now(number: u32, of: u64) -> bool {
    if !fault(number) {
        return false;
    }
    let next = |state: u64| state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let order = std::sync::atomic::Ordering::SeqCst;
    let state = FAULTS_DRAWN.fetch_update(order, order, |state| Some(next(state))).unwrap_or_default();
    (state >> 33) % of == 0
}

/// Where the sequence stands.
pub static FAULTS_DRAWN: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(1);

/// A frame with another digit, or letter, at its end.
pub fn fault_changed(frame: &[u8]) -> bytes::Bytes {
    let mut frame = frame.to_vec();
    if let Some(last) = frame.iter_mut().rev().find(|byte| byte.is_ascii_alphanumeric()) {
        *last ^= 1;
    }
    frame.into()
}
"""


def text_of(root, number, fault):
    """The text of the fault's file, if the right text stands in it once; else nothing, and says why."""
    what, file, right, _ = fault
    path = root / file
    text = path.read_text() if path.exists() else ""
    if text.count(right) == 1:
        return text
    print(f"fault {number} ({what}): {file} has {text.count(right)} times {right!r}", file=sys.stderr)
    return None


def misplaced(root, faults):
    """The faults (what is wrong, file, right text, wrong text) that have no place in the sources any more, by number."""
    return [number for number, fault in enumerate(faults, 1) if text_of(root, number, fault) is None]


def plant(root, copy, parts, faults):
    """Copies `parts` of the sources and puts the faults in (what is wrong, file, right text, wrong text); gives those that have no
    place there any more, by number."""
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir(parents=True)
    for part in parts:
        if (root / part).is_dir():
            shutil.copytree(root / part, copy / part)
        elif (root / part).exists():
            (copy / part).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(root / part, copy / part)
    library = copy / "src/lib.rs"
    library.write_text(library.read_text() + SWITCH)
    missing = []
    for number, fault in enumerate(faults, 1):
        _, file, right, wrong = fault
        text = text_of(copy, number, fault)
        if text is None:
            missing.append(number)
            continue
        wrong = re.sub(r"\bR\((\d+)\)", rf"crate::fault_now({number}, \1)", wrong)
        (copy / file).write_text(text.replace(right, re.sub(r"\bF\b", f"crate::fault({number})", wrong)))
    return missing
