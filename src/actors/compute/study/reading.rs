//! How questions to `study` are read: as a whole.
//!
//! **Invariant:** one bad field refuses the whole question, and each bad field is named.

use crate::protocol::op::fields::{Fields, Rejections};

/// The question, unless a field of it was rejected.
pub(super) fn taken<A>(ask: A, fields: Fields<'_>) -> Result<A, Rejections> {
    if fields.accepted() {
        Ok(ask)
    } else {
        Err(fields.finish())
    }
}
