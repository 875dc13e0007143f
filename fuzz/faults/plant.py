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


def misplaced(root, faults):
    """The faults (what is wrong, file, right text, wrong text) whose right text does not stand once in its file, by number; says why."""
    missing = []
    for number, (what, file, right, _) in enumerate(faults, 1):
        path = root / file
        count = path.read_text().count(right) if path.exists() else 0
        if count != 1:
            print(f"fault {number} ({what}): {file} has {count} times {right!r}", file=sys.stderr)
            missing.append(number)
    return missing


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
    missing = misplaced(root, faults)
    for number, (_, file, right, wrong) in enumerate(faults, 1):
        if number in missing:
            continue
        path = copy / file
        text = path.read_text()
        wrong = re.sub(r"\bR\((\d+)\)", rf"crate::fault_now({number}, \1)", wrong)
        # Another fault may have changed the text since.
        if text.count(right) != 1:
            print(f"fault {number}: another stands in its place", file=sys.stderr)
            missing.append(number)
            continue
        path.write_text(text.replace(right, re.sub(r"\bF\b", f"crate::fault({number})", wrong)))
    return missing
