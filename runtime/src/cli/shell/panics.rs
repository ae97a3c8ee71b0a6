//! Panics of nodes and devices during a run.

/// Runs `work` without the message that the standard library prints for each panic.
///
/// A panic of a node or a device becomes a fault, which names it. Any other panic is a bug of the runtime and continues
/// with its payload.
pub(crate) fn without_panic_messages<T>(work: impl FnOnce() -> T) -> T {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    std::panic::set_hook(hook);
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
