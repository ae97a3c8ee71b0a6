//! Each mistake in a declaration is a compile error on its field or its attribute: `errors/*.rs` with what the compiler
//! says beside it. `TRYBUILD=overwrite` writes that anew: read the difference before you commit it.

#[test]
fn every_mistake_shows_on_its_field() {
    // Without a case that compiles, trybuild only checks the dependencies, which takes half the time.
    trybuild::TestCases::new().compile_fail("tests/errors/*.rs");
}
