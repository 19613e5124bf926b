//! The binary format alone is tested through layers in `usd/tests.rs`; here: words of values.

use super::{Rep, types};

#[test]
fn words_hold_type_flags_and_payload() {
    let rep = Rep::new(types::INT, Rep::ARRAY | Rep::COMPRESSED, 0x1234_5678_9abc);
    assert_eq!(rep.0, 0xa003_1234_5678_9abc);
    assert_eq!((rep.value_type(), rep.payload()), (types::INT, 0x1234_5678_9abc));
    assert!(rep.has(Rep::ARRAY) && !rep.has(Rep::INLINED));
    // A payload never reaches the type.
    assert_eq!(Rep::new(types::INT, 0, u64::MAX).value_type(), types::INT);
}
