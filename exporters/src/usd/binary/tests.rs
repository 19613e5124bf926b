//! Tests of value words; the binary format as a whole is tested through layers in `usd/tests`.

use super::{Rep, types};

#[test]
fn words_hold_type_flags_and_payload() {
    let rep = Rep::new(types::INT, Rep::ARRAY | Rep::COMPRESSED, 0x1234_5678_9abc);
    assert_eq!(rep.0, 0xa003_1234_5678_9abc);
    assert_eq!((rep.value_type(), rep.payload()), (types::INT, 0x1234_5678_9abc));
    assert_eq!(rep.flags(), Rep::ARRAY | Rep::COMPRESSED);
    assert_eq!(Rep::inlined(types::TOKEN, 7).word(), 7);
    // A payload never reaches the type.
    assert_eq!(Rep::new(types::INT, 0, u64::MAX).value_type(), types::INT);
}
