//! Admission over HTTP: a second opinion, from the bytes of a request alone.
//!
//! It is written from the README's rules, not from the runtime's code, and knows one address: 127.0.0.1:9095.

use std::borrow::Cow;
use std::net::IpAddr;

/// The rules in force.
#[derive(Debug, Clone, Copy)]
pub struct Rules<'a> {
    /// The token that has to be shown, if any.
    pub token: Option<&'a str>,
    /// `arm.example:80` is a name of ours.
    pub has_name: bool,
    /// Pages without an origin may open a WebSocket.
    pub allows_null: bool,
    /// Other pages of this machine may not.
    pub is_strict: bool,
}

/// The fates of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Opinion {
    /// It says nothing, or not once, of the host that it looks for.
    NoHost,
    /// It may not in.
    Refused,
    /// It may have the page, the report, or a sentence about what is not there.
    Page,
    /// It may open a WebSocket, if it does so rightly.
    Socket,
}

/// A head, taken apart as far as the rules need it.
struct Head {
    target: String,
    /// Names in lower case, values without white space around them.
    headers: Vec<(String, String)>,
    /// Every line is as the RFC has it, so that there is only one way to read it.
    is_plain: bool,
}

/// The fate that a request must have, and whether that is certain. A request may be too odd to be read by anybody, and
/// then must not be let in because of this reading. `None` if it is no whole GET or HEAD request.
#[must_use]
pub fn judge(bytes: &[u8], rules: Rules<'_>) -> Option<(Opinion, bool)> {
    let head = read(bytes)?;
    Some((opinion(&head, rules), head.is_plain))
}

/// Stands for a value that is no text.
const NO_TEXT: &str = "\u{fffd}";

fn read(bytes: &[u8]) -> Option<Head> {
    let ends = [&b"\n\r\n"[..], b"\n\n"];
    let end = ends.iter().filter_map(|mark| {
        let at = bytes.windows(mark.len()).position(|window| window == *mark);
        at.map(|at| at + mark.len())
    });
    let end = end.min()?;
    let head = &bytes[..end];
    let bare = String::from_utf8_lossy(head).replace("\r\n", "");
    let mut is_plain = head.is_ascii() && end <= 8 * 1024 && !bare.contains(['\r', '\n']);
    // A value may hold any byte: one that is no text is not the one that is looked for, but stands
    // there.
    let mut lines = head
        .split(|&byte| byte == b'\n')
        .map(|line| String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)));
    let first = lines.next()?;
    let (method, first) = first.split_once(' ')?;
    if !matches!(method, "GET" | "HEAD") {
        return None;
    }
    let (target, version) = first.split_once(' ').unwrap_or((first, ""));
    is_plain &= matches!(version, "HTTP/1.1" | "HTTP/1.0");
    is_plain &= target.starts_with('/') && target.bytes().all(|byte| byte.is_ascii_graphic());
    is_plain &= !target.contains(['"', '<', '>', '\\', '^', '`', '{', '|', '}']);
    // A fragment is not part of a request, and is not looked at.
    let target = target.split_once('#').map_or(target, |(before, _)| {
        is_plain = false;
        before
    });
    let mut headers = Vec::new();
    for line in lines.filter(|line| !line.is_empty()) {
        let is_text = matches!(line, Cow::Borrowed(_));
        let Some((name, value)) = line.split_once(':') else {
            is_plain = false;
            continue;
        };
        let in_name = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-';
        is_plain &= !name.is_empty() && name.bytes().all(in_name);
        let in_value = |byte: u8| byte.is_ascii_graphic() || byte == b' ';
        is_plain &= value.bytes().all(in_value);
        let value = value.trim_matches([' ', '\t']);
        let is_kept = is_text || name.eq_ignore_ascii_case("cookie");
        let value = if is_kept { value } else { NO_TEXT };
        headers.push((name.to_ascii_lowercase(), value.to_owned()));
    }
    is_plain &= headers.len() <= 32;
    // A request with a body is refused, whoever asks.
    let has_body = |name: &str| ["content-length", "transfer-encoding"].contains(&name);
    is_plain &= !headers.iter().any(|(name, _)| has_body(name));
    Some(Head {
        target: target.to_owned(),
        headers,
        is_plain,
    })
}

impl Head {
    fn all(&self, name: &str) -> Vec<&str> {
        let named = self.headers.iter().filter(|(one, _)| one == name);
        named.map(|(_, value)| value.as_str()).collect()
    }
}

fn opinion(head: &Head, rules: Rules<'_>) -> Opinion {
    let hosts = head.all("host");
    let [host] = hosts[..] else {
        return Opinion::NoHost;
    };
    let Some(own) = place(host).filter(|own| is_ours(own, rules)) else {
        return Opinion::Refused;
    };
    let upgrades = head.all("upgrade");
    let mut words = upgrades.iter().flat_map(|value| value.split(','));
    let opens_socket = words.any(|word| word.trim().eq_ignore_ascii_case("websocket"))
        || !head.all("sec-websocket-key").is_empty();
    if opens_socket && !may_open(&head.all("origin"), &own, rules) {
        return Opinion::Refused;
    }
    if rules.token.is_some_and(|token| !shows(head, token)) {
        return Opinion::Refused;
    }
    if opens_socket {
        Opinion::Socket
    } else {
        Opinion::Page
    }
}

/// A host and a port, as `http` means them: 80 if none is written.
type Place = (String, u16);

fn place(text: &str) -> Option<Place> {
    let (host, port) = match text.rfind(':') {
        Some(at) if !text.ends_with(']') => (&text[..at], &text[at + 1..]),
        _ => (text, "80"),
    };
    if port.is_empty() || !port.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let port = port.parse().ok()?;
    let inner = host
        .strip_prefix('[')
        .and_then(|host| host.strip_suffix(']'));
    if let Some(inner) = inner {
        let address: std::net::Ipv6Addr = inner.parse().ok()?;
        return Some((address.to_string(), port));
    }
    let in_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let is_name = !host.is_empty() && host.len() <= 253 && host.bytes().all(in_name);
    is_name.then(|| (host.to_ascii_lowercase(), port))
}

fn is_this_machine(host: &str) -> bool {
    host == "localhost"
        || host
            .parse::<IpAddr>()
            .is_ok_and(|address| address.is_loopback())
}

fn is_ours((host, port): &Place, rules: Rules<'_>) -> bool {
    let name = host.strip_suffix('.').unwrap_or(host);
    is_this_machine(host) || (rules.has_name && name == "arm.example" && *port == 80)
}

fn may_open(origins: &[&str], own: &Place, rules: Rules<'_>) -> bool {
    match origins {
        [] => true,
        [origin] => {
            let origin = origin.to_ascii_lowercase();
            let page = origin.strip_prefix("http://").and_then(place);
            let is_local = page.as_ref().is_some_and(|(host, _)| is_this_machine(host));
            page.as_ref() == Some(own)
                || (rules.allows_null && origin == "null")
                || (is_local && !rules.is_strict && rules.token.is_none())
        }
        _ => false,
    }
}

fn shows(head: &Head, token: &str) -> bool {
    let query = head.target.split_once('?').map(|(_, query)| query);
    let in_query = first_of(
        query.into_iter().flat_map(|query| query.split('&')),
        "token",
    );
    if let Some(shown) = in_query {
        return shown == token.as_bytes();
    }
    let cookies = head.all("cookie");
    let pairs = cookies
        .iter()
        .flat_map(|value| value.split(';'))
        .map(str::trim);
    first_of(pairs, "pendularm_9095").is_some_and(|shown| shown == token.as_bytes())
}

/// The first value of that name, if its bytes can be read and are text.
fn first_of<'a>(pairs: impl Iterator<Item = &'a str>, name: &str) -> Option<Vec<u8>> {
    let mut named = pairs.filter_map(|pair| pair.strip_prefix(name)?.strip_prefix('='));
    let mut bytes = Vec::new();
    let mut rest = named.next()?.as_bytes();
    while let [first, behind @ ..] = rest {
        rest = behind;
        if *first != b'%' {
            bytes.push(*first);
            continue;
        }
        let digit = |byte: u8| char::from(byte).to_digit(16);
        let [high, low, behind @ ..] = rest else {
            return None;
        };
        bytes.push(u8::try_from(digit(*high)? * 16 + digit(*low)?).ok()?);
        rest = behind;
    }
    String::from_utf8(bytes).ok().map(String::into_bytes)
}
