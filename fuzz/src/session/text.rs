//! The text of frames: payloads, names, fields of services.

use super::*;

pub(super) const TOPICS: [&str; 10] = [
    "/a",
    "a",
    "/b/c",
    "/\u{e9}",
    "/joint_trajectory",
    "/joint_states",
    "clock",
    "/tf_static",
    "/rosout",
    "//a",
];
pub(super) const SERVICES: [&str; 6] =
    ["/s", "s", "/t/u", "/nobody", "/arm_sim/pause", "/rosapi/x"];
pub(super) const VALUES: [&str; 12] = [
    "{}",
    "null",
    "[]",
    "{\"data\":true}",
    "[1,2,3]",
    "{\"a\":1e999,\"b\":[NaN,-Infinity]}",
    "{\"x\":18446744073709551616,\"y\":-0.0}",
    "\"\\ud83d\\ude00\\n\"",
    "7",
    "{\"points\":[{\"positions\":[0.1,0.2]}]}",
    "{\"header\":{\"stamp\":{\"sec\":1,\"nanosec\":5}},\"position\":[1,null]}",
    "{\"function\":\"t\",\"x0\":0,\"dt\":1,\"steps\":1,\"integrator\":\"rk4\"}",
];

impl Payload<'_> {
    pub(super) fn json(&self) -> Option<String> {
        Some(match self {
            Self::Absent => return None,
            Self::Known(number) => VALUES[usize::from(*number) % VALUES.len()].to_owned(),
            Self::Text(text) => quoted(text),
            Self::Number(number) => python(*number),
            Self::Numbers(numbers) => {
                let numbers: Vec<String> = numbers.iter().copied().map(python).collect();
                format!("{{\"position\":[{}]}}", numbers.join(","))
            }
            Self::Long(length) => quoted(&"x\u{e9}".repeat(usize::from(*length) / 8)),
            Self::Fitting(numbers, _) => python(numbers[0]),
            Self::Deep(levels) => {
                let levels = usize::from(*levels) % 100;
                "[".repeat(levels) + "1" + &"]".repeat(levels)
            }
        })
    }
}

/// A number as Python's `json` writes it.
pub(super) fn python(number: f64) -> String {
    format!("{number:e}").replace("inf", "Infinity")
}

/// A text as JSON.
pub(super) fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

pub(super) fn put(frame: &mut String, key: &str, value: Option<&impl std::fmt::Display>) {
    if let Some(value) = value {
        let _ = write!(frame, ",\"{key}\":{value}");
    }
}

pub(super) fn topic_of(number: u8) -> String {
    quoted(TOPICS[usize::from(number) % TOPICS.len()])
}

/// A client's service, or one of the runtime's.
pub(super) fn service_name(number: u8) -> &'static str {
    let number = usize::from(number);
    let rosapi = Rosapi::ALL.into_iter().map(Service::Rosapi);
    let mut own = Service::ALL.into_iter().chain(rosapi).map(Service::name);
    match number {
        0..128 => SERVICES[number % SERVICES.len()],
        _ => own.nth(number - 128).unwrap_or(SERVICES[0]),
    }
}

pub(super) fn service_of(number: u8) -> String {
    quoted(service_name(number))
}

/// Arguments that a service could take.
pub(super) fn fitting(service: &str, numbers: &[f64; 4], without: u8) -> String {
    const TEXTS: [&str; 8] = [
        "rk4",
        "euler",
        "verlet",
        "/a",
        "timestep",
        "std_msgs/Header",
        "/ik_action",
        "0.01",
    ];
    let fields = Service::from_name(service).map_or(&[][..], Service::fields);
    let mut args = String::from("{\"unknown\":null");
    for (index, field) in fields.iter().enumerate() {
        if index < 8 && without >> index & 1 == 1 {
            continue;
        }
        let number = python(numbers[index % 4]);
        let value = match field.kind {
            "float64" => number,
            "float64[]" => format!("[{number},{}]", python(numbers[(index + 1) % 4])),
            "bool" => (numbers[index % 4] > 0.0).to_string(),
            "uint64" => (numbers[index % 4].abs() % 300.0).floor().to_string(),
            "string" => quoted(TEXTS[usize::from(without ^ index as u8) % TEXTS.len()]),
            _ => format!("{{\"kp\":[{number},{number}],\"gravity\":{number}}}"),
        };
        put(&mut args, field.name, Some(&value));
    }
    args + "}"
}
