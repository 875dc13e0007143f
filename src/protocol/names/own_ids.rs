//! Ids of the runtime's own requests.
//!
//! **Invariant:** a number has one id, and each spelling of the id in JSON has that number.

/// The prefix of the runtime's own ids, of forwarded calls and of fragmented messages. It shows their origin in a
/// client's log.
const OWN_ID_PREFIX: &str = "pendularm:";
/// Longest spelling of an own id in JSON: prefix, twenty digits, quotes, each character escaped as `\u0070`.
const LONGEST_ID: usize = 6 * (OWN_ID_PREFIX.len() + 20) + 2;

/// The id of request `number` at its provider, or of the pieces of a message.
#[must_use]
pub fn own_id(number: u64) -> String {
    format!("{OWN_ID_PREFIX}{number}")
}

/// The number of the request that has this id, which is JSON.
#[must_use]
pub fn own_id_number(id: &str) -> Option<u64> {
    let id = Some(id).filter(|id| id.len() <= LONGEST_ID)?;
    let id: String = serde_json::from_str(id).ok()?;
    let number: u64 = id.strip_prefix(OWN_ID_PREFIX)?.parse().ok()?;
    // Each request has one id, though `+1` and `01` are numbers too.
    (id == own_id(number)).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calls_id_is_known_however_its_provider_spells_it() {
        let id = own_id(u64::MAX);
        let escaped: String = id.bytes().map(|byte| format!("\\u{byte:04x}")).collect();
        for spelling in [format!("\"{id}\""), format!("\"{escaped}\"")] {
            assert_eq!(own_id_number(&spelling), Some(u64::MAX));
        }
        let another = format!("\"{OWN_ID_PREFIX}01\"");
        assert_eq!(own_id_number(&another), None);
    }
}
