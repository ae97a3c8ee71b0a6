//! Each mistake in a declaration is a compile error on its field or its attribute: `errors/*.rs` with what the compiler
//! says beside it. `TRYBUILD=overwrite` writes that anew: read the difference before you commit it.

#[test]
fn every_mistake_shows_on_its_field() {
    let cases = trybuild::TestCases::new();
    // A case that compiles makes trybuild build the others too: some mistakes show only then.
    cases.pass("tests/sound/*.rs");
    cases.compile_fail("tests/errors/*.rs");
}
