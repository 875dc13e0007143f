//! The report's drawings: numbers as people write them, ticks, headings, and the names of curves in files.

use std::collections::BTreeSet;

use pendularm::report::svg::numbers::{number, plain, power, seconds};
use pendularm::report::svg::{Axis, Curve, Key, Plot, Unit, csv, lines};

#[test]
fn numbers_are_written_as_people_write_them() {
    let cases = [
        (0.0, "0"),
        (1234.0, "1234"),
        (0.031_26, "0.0313"),
        (99.96, "100"),
        (2.5, "2.5"),
        (2.3e-9, "2.3·10⁻⁹"),
        (-3.0, "-3"),
        (100.0, "100"),
    ];
    for (value, text) in cases {
        assert_eq!(number(value), text);
    }
    assert_eq!(seconds(0.000_25), "250\u{a0}µs");
    assert_eq!(seconds(0.001), "1\u{a0}ms");
    assert_eq!([-16.0, 0.0, 1.0].map(power), ["10⁻¹⁶", "1", "10"]);
}

#[test]
fn powers_of_ten_in_a_text_are_written_as_people_write_them() {
    let cases = [
        ("off by 3.5600e-3 s, 2e9.", "off by 3.6·10⁻³ s, 2.0·10⁹."),
        ("0.0000e0 rad", "0 rad"),
        (
            "euler 1.2e-9 (slope 1.0), step 2-3",
            "euler 1.2·10⁻⁹ (slope 1.0), step 2-3",
        ),
        ("1 degree", "1 degree"),
    ];
    for (text, expected) in cases {
        assert_eq!(plain(text), expected);
    }
}

#[test]
fn ticks_stand_at_multiples_of_their_stride() {
    let labels = |axis: Axis, most| {
        let labels: Vec<String> = axis.ticks(most).into_iter().map(|tick| tick.1).collect();
        labels.join(", ").replace('\u{a0}', " ")
    };
    let wide = Axis::around("", Unit::Number, [3e-16, 2.0]);
    assert_eq!(labels(wide, 5.0), "10⁻¹⁶, 10⁻¹², 10⁻⁸, 10⁻⁴, 1");
    let times = Axis::around("", Unit::Seconds, [2e-6, 0.03]);
    let decades = "1 µs, 10 µs, 100 µs, 1 ms, 10 ms, 100 ms";
    assert_eq!(labels(times, 9.0), decades);
    let linear = Axis::linear("", (0.0, 30.0));
    assert_eq!(labels(linear, 6.0), "0, 5, 10, 15, 20, 25, 30");
}

#[test]
fn a_heading_takes_as_many_lines_as_it_needs_and_loses_no_word() {
    const LETTER: f64 = 10.4;
    let heading = "With the effort held, midpoint, Verlet and RK4 go unstable at the same timestep";
    for room in [100.0, 400.0, 812.0, 5000.0] {
        let lines = lines(heading, room, LETTER);
        assert_eq!(lines.join(" "), heading);
        for line in &lines {
            let fits = LETTER * line.chars().count() as f64 <= room;
            assert!(fits || !line.contains(' '), "{line}");
        }
    }
    assert_eq!(lines(heading, 5000.0, LETTER).len(), 1);
}

#[test]
fn curves_that_look_different_have_different_names() {
    let axis = || Axis::linear("x", (0.0, 1.0));
    let key = || Key::line("euler", "Euler");
    let points = [(0.0, 1.0)];
    let unnamed = Key::line("rk4", "").dashed();
    let plot = Plot::new("panel", axis(), axis()).with([
        Curve::line(key(), points),
        Curve::line(key().dashed(), points),
        Curve::dots(key(), points),
        Curve::line(Key::line("rk4", "rk4"), points),
        Curve::line(unnamed, points),
    ]);
    // All points are alike, and differ by the names of their curves.
    let lines = csv(&[plot]);
    let names: BTreeSet<&str> = lines.lines().skip(1).collect();
    assert_eq!(names.len(), 5, "{names:?}");
}

#[test]
fn a_column_is_named_by_its_axis_with_the_unit() {
    let draw = |y| {
        let x = Axis::log("timestep", Unit::Seconds, (1e-3, 1.0));
        let key = Key::line("rk4", "rk4");
        Plot::new("panel", x, y).with([Curve::line(key, [(0.5, 2.0)])])
    };
    let panels = [
        draw(Axis::linear("largest error [rad]", (0.0, 3.0))),
        draw(Axis::linear("growth, per period", (0.0, 3.0))),
    ];
    assert_eq!(
        csv(&panels),
        "curve,timestep [s],largest error [rad],\"growth, per period\",note\n\
         panel: rk4,5e-1,2e0,,\n\
         panel: rk4,5e-1,,2e0,\n"
    );
}
