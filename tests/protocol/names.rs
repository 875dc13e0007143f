//! Spellings of names and types.

use pendularm::protocol::names::{absolute, relative, same_type, short_type, spellings};

#[test]
fn a_name_is_the_same_with_and_without_its_slash() {
    assert_eq!(absolute("rosapi/topics"), "/rosapi/topics");
    assert_eq!(absolute("/rosapi/topics"), "/rosapi/topics");
    assert_eq!(relative("/x"), "x");
    assert_eq!(relative("x"), "x");
    assert_eq!(relative("//x"), "//x", "/x is another");
    assert_eq!(spellings("/x").collect::<Vec<_>>(), ["/x", "x"]);
}

#[test]
fn a_type_is_the_same_with_and_without_its_middle_part() {
    assert!(same_type("std_msgs/Header", "std_msgs/msg/Header"));
    assert!(same_type("a/b", "a/b"));
    assert!(!same_type("std_msgs/msg/Header", "std_msgs/srv/Header"));
    assert!(!same_type("std_msgs/Header", "other_msgs/msg/Header"));
    assert!(same_type("std_msgs/msg/Header", "std_msgs/Header"));
    assert!(!same_type("a/b", "a/bb"));
    assert!(!same_type("a/b", "aa/x/b"));
    assert!(!same_type("aa/aa", "aa/a"));
    assert!(!same_type("plain", "plain/msg/plain"));
    assert_eq!(short_type("plain"), "plain");
}
