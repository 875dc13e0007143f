//! A JSON message for conversion to another encoding. All its values are in one array, in order.
//!
//! A node takes [`NODE_BYTES`], and there is at most one for every two bytes of text (`1,1,1,`, `[[[[`). So the
//! longest message takes at most 48 MiB. Texts are borrowed from the input. Texts with escapes are copied: 8 more
//! bytes for every 5.
//!
//! **Invariant:** a value is followed by its contents, and then by the next value. There are no pointers between nodes,
//! so dropping a tree is a loop.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Number, Value};

/// Bytes of memory for each value, and for each member's name.
pub const NODE_BYTES: usize = size_of::<TreeNode<'_>>();
const _: () = assert!(NODE_BYTES <= 24, "the documents say so");

/// A parsed JSON value with its contents.
#[derive(Debug, Clone)]
pub struct MessageTree<'a> {
    nodes: Vec<TreeNode<'a>>,
}

#[derive(Debug, Clone)]
enum TreeNode<'a> {
    Null,
    Bool(bool),
    Number(Number),
    Text(Cow<'a, str>),
    Array(Extent),
    /// The members. Each is a name, as a text, followed by its value.
    Object(Extent),
}

/// The length of an array or object.
#[derive(Debug, Clone, Copy)]
struct Extent {
    /// Entries or members.
    count: usize,
    /// Nodes, including its own.
    nodes: usize,
}

impl<'a> MessageTree<'a> {
    /// Upper bound on the memory of the tree of a JSON text, in bytes. One of four characters precedes every value
    /// except the first. Such characters inside texts are counted too.
    #[must_use]
    pub fn room(text: &[u8]) -> usize {
        let is_in_front = |byte: &u8| u8::from(matches!(byte, b',' | b':' | b'[' | b'{'));
        // The counts of a chunk are sums in bytes: many are added at a time. No chunk has more than 255 of them.
        let chunks = text.chunks(usize::from(u8::MAX));
        let counts = chunks.map(|chunk| chunk.iter().map(is_in_front).sum::<u8>());
        let in_front: usize = counts.map(usize::from).sum();
        NODE_BYTES * (1 + in_front.min(text.len() / 2))
    }

    /// Reads a JSON text.
    ///
    /// # Errors
    /// If it is not JSON, is nested deeper than 127 levels, or has a number beyond the range of doubles.
    pub fn read(text: &'a [u8]) -> Result<Self, serde_json::Error> {
        let mut nodes = Vec::with_capacity(Self::room(text) / NODE_BYTES);
        let mut reader = serde_json::Deserializer::from_slice(text);
        TreeReader(&mut nodes).deserialize(&mut reader)?;
        reader.end()?;
        Ok(Self { nodes })
    }

    /// The whole value.
    #[must_use]
    pub fn root(&self) -> Branch<'_, 'a> {
        Branch { nodes: &self.nodes }
    }

    /// Bytes of used memory, without texts that had escapes.
    #[must_use]
    pub fn allocated(&self) -> usize {
        self.nodes.capacity() * NODE_BYTES
    }
}

impl<'a> From<&'a Value> for MessageTree<'a> {
    fn from(value: &'a Value) -> Self {
        let mut nodes = Vec::new();
        let read = TreeReader(&mut nodes).deserialize(value);
        debug_assert!(read.is_ok(), "every value can be a node");
        Self { nodes }
    }
}

/// Appends the next value with its contents to the nodes.
struct TreeReader<'t, 'a>(&'t mut Vec<TreeNode<'a>>);

impl<'a> TreeReader<'_, 'a> {
    /// Sets the number of entries of the array or object at node `at` to `count`.
    fn close<E>(self, at: usize, kind: fn(Extent) -> TreeNode<'a>, count: usize) -> Result<(), E> {
        let nodes = self.0.len() - at;
        if let Some(node) = self.0.get_mut(at) {
            *node = kind(Extent { count, nodes });
        }
        Ok(())
    }

    fn put<E>(self, node: TreeNode<'a>) -> Result<(), E> {
        self.0.push(node);
        Ok(())
    }
}

impl<'a> DeserializeSeed<'a> for TreeReader<'_, 'a> {
    type Value = ();

    fn deserialize<D: Deserializer<'a>>(self, reader: D) -> Result<(), D::Error> {
        reader.deserialize_any(self)
    }
}

impl<'a> Visitor<'a> for TreeReader<'_, 'a> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        self.put(TreeNode::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<(), E> {
        self.put(TreeNode::Bool(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        self.put(TreeNode::Number(value.into()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        self.put(TreeNode::Number(value.into()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        self.put(Number::from_f64(value).map_or(TreeNode::Null, TreeNode::Number))
    }

    fn visit_borrowed_str<E>(self, value: &'a str) -> Result<(), E> {
        self.put(TreeNode::Text(Cow::Borrowed(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<(), E> {
        self.put(TreeNode::Text(Cow::Owned(value.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'a>>(self, mut seq: A) -> Result<(), A::Error> {
        let at = self.0.len();
        self.0.push(TreeNode::Null);
        let mut count = 0;
        while seq.next_element_seed(TreeReader(self.0))?.is_some() {
            count += 1;
        }
        self.close(at, TreeNode::Array, count)
    }

    fn visit_map<A: MapAccess<'a>>(self, mut map: A) -> Result<(), A::Error> {
        let at = self.0.len();
        self.0.push(TreeNode::Null);
        let mut count = 0;
        while map.next_key_seed(TreeReader(self.0))?.is_some() {
            map.next_value_seed(TreeReader(self.0))?;
            count += 1;
        }
        self.close(at, TreeNode::Object, count)
    }
}

/// A value in a tree: its node, and the nodes of its contents.
#[derive(Debug, Clone, Copy)]
pub struct Branch<'t, 'a> {
    nodes: &'t [TreeNode<'a>],
}

/// The kinds of values.
#[derive(Debug, Clone)]
pub enum BranchKind<'t, 'a> {
    /// `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A number.
    Number(&'t Number),
    /// A text, without its escapes.
    Text(&'t str),
    /// An array's entries.
    Array(BranchEntries<'t, 'a>),
    /// An object's members.
    Object(BranchMembers<'t, 'a>),
}

impl<'t, 'a> Branch<'t, 'a> {
    /// `false`.
    pub const FALSE: Self = Branch {
        nodes: &[TreeNode::Bool(false)],
    };

    /// The value.
    #[must_use]
    pub fn kind(self) -> BranchKind<'t, 'a> {
        let Some((first, rest)) = self.nodes.split_first() else {
            return BranchKind::Null;
        };
        match first {
            TreeNode::Null => BranchKind::Null,
            TreeNode::Bool(value) => BranchKind::Bool(*value),
            TreeNode::Number(number) => BranchKind::Number(number),
            TreeNode::Text(text) => BranchKind::Text(text),
            TreeNode::Array(extent) => BranchKind::Array(BranchEntries {
                rest,
                left: extent.count,
            }),
            TreeNode::Object(extent) => BranchKind::Object(BranchMembers {
                rest,
                left: extent.count,
            }),
        }
    }

    /// The object's member of that name; the last one if there are several.
    #[must_use]
    pub fn get(self, name: &str) -> Option<Self> {
        let found = self.members()?.filter(|(one, _)| *one == name);
        found.last().map(|(_, value)| value)
    }

    /// The value at that path. Each part is a slash with the name of a member, or `0` for an array's first entry.
    #[must_use]
    pub fn pointer(self, way: &str) -> Option<Self> {
        way.split('/')
            .skip(1)
            .try_fold(self, |at, part| match at.kind() {
                BranchKind::Array(mut entries) => entries.next().filter(|_| part == "0"),
                _ => at.get(part),
            })
    }

    /// The entries, if it is an array.
    #[must_use]
    pub fn entries(self) -> Option<BranchEntries<'t, 'a>> {
        match self.kind() {
            BranchKind::Array(entries) => Some(entries),
            _ => None,
        }
    }

    /// The members, if it is an object.
    #[must_use]
    pub fn members(self) -> Option<BranchMembers<'t, 'a>> {
        match self.kind() {
            BranchKind::Object(members) => Some(members),
            _ => None,
        }
    }

    /// The text, if it is one.
    #[must_use]
    pub fn as_str(self) -> Option<&'t str> {
        match self.kind() {
            BranchKind::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The boolean, if it is one.
    #[must_use]
    pub fn as_bool(self) -> Option<bool> {
        match self.kind() {
            BranchKind::Bool(value) => Some(value),
            _ => None,
        }
    }

    /// The number, if it is a whole number, not negative, and fits.
    #[must_use]
    pub fn as_u64(self) -> Option<u64> {
        self.number()?.as_u64()
    }

    /// The number, if it is a whole number and fits.
    #[must_use]
    pub fn as_i64(self) -> Option<i64> {
        self.number()?.as_i64()
    }

    /// The number, if it is one.
    #[must_use]
    pub fn as_f64(self) -> Option<f64> {
        self.number()?.as_f64()
    }

    fn number(self) -> Option<&'t Number> {
        let BranchKind::Number(number) = self.kind() else {
            return None;
        };
        Some(number)
    }
}

/// The entries of an array, in order.
#[derive(Debug, Clone)]
pub struct BranchEntries<'t, 'a> {
    /// The nodes of the remaining ones, and others after them.
    rest: &'t [TreeNode<'a>],
    left: usize,
}

impl<'t, 'a> Iterator for BranchEntries<'t, 'a> {
    type Item = Branch<'t, 'a>;

    fn next(&mut self) -> Option<Self::Item> {
        self.left = self.left.checked_sub(1)?;
        next_branch(&mut self.rest)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left, Some(self.left))
    }
}

impl ExactSizeIterator for BranchEntries<'_, '_> {}

/// The members of an object in written order, including repeated names.
#[derive(Debug, Clone)]
pub struct BranchMembers<'t, 'a> {
    /// The nodes of the remaining ones, and others after them.
    rest: &'t [TreeNode<'a>],
    left: usize,
}

impl<'t, 'a> Iterator for BranchMembers<'t, 'a> {
    type Item = (&'t str, Branch<'t, 'a>);

    fn next(&mut self) -> Option<Self::Item> {
        self.left = self.left.checked_sub(1)?;
        let name = next_branch(&mut self.rest)?.as_str()?;
        Some((name, next_branch(&mut self.rest)?))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left, Some(self.left))
    }
}

impl ExactSizeIterator for BranchMembers<'_, '_> {}

impl<'t, 'a> BranchMembers<'t, 'a> {
    /// Whether the names are in ascending order.
    #[must_use]
    pub fn are_in_order(&self) -> bool {
        let names = self.clone().map(|(name, _)| name);
        names.is_sorted_by(|one, next| one < next)
    }

    /// The members by name, each name once. Of repeated names the last member counts. It takes 8 bytes for each
    /// member, whose text has at least 5.
    pub fn in_order(
        &self,
    ) -> impl ExactSizeIterator<Item = (&'t str, Branch<'t, 'a>)> + use<'t, 'a> {
        let nodes = self.rest;
        let member = move |place: usize| {
            let rest = nodes.get(place..).unwrap_or_default();
            BranchMembers { rest, left: 1 }
                .next()
                .unwrap_or(("", Branch::FALSE))
        };
        let mut places = Vec::with_capacity(self.left);
        let mut all = self.clone();
        for _ in 0..self.left {
            places.push(nodes.len() - all.rest.len());
            all.next();
        }
        let name = |place: usize| member(place).0;
        places.sort_unstable_by(|one, other| {
            (name(*one), Reverse(one)).cmp(&(name(*other), Reverse(other)))
        });
        places.dedup_by(|earlier, last| name(*earlier) == name(*last));
        places.into_iter().map(member)
    }
}

/// Takes the first value of `rest` from it.
fn next_branch<'t, 'a>(rest: &mut &'t [TreeNode<'a>]) -> Option<Branch<'t, 'a>> {
    let nodes = match rest.first()? {
        TreeNode::Array(extent) | TreeNode::Object(extent) => extent.nodes,
        _ => 1,
    };
    let (nodes, behind) = rest.split_at_checked(nodes)?;
    *rest = behind;
    Some(Branch { nodes })
}
