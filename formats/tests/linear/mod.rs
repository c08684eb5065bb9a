//! Whether work grows with the bytes and no faster, told by the processor time of this thread: what
//! else the machine does, and waiting for it, count nothing.
//!
//! A text of ten times as many parts is read once, and the small one ten times. Of linear work both
//! take as long; of quadratic work the large one takes ten times as long.

use std::fs;
use std::time::Duration;

/// A kind of text by its name, given the number of its parts.
pub(crate) type Shape = (&'static str, fn(usize) -> String);

const TIMES: usize = 10;
/// Caches hold more of a small text than of a large one.
const MOST: f64 = 4.0;
/// The system counts in ticks of some milliseconds; what is less than a few of them is as good as
/// nothing.
const LEAST: Duration = Duration::from_millis(40);
/// A machine may be disturbed; quadratic work is quadratic every time.
const ROUNDS: usize = 5;

/// Processor time that this thread has had so far; none where the system does not say (Linux does).
fn worked() -> Option<Duration> {
    let said = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = said.split(' ').next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

/// How many times as long a text of `10 n` parts takes as ten texts of `n` parts.
fn growth(n: usize, shape: &dyn Fn(usize) -> String, read: &dyn Fn(&str)) -> Option<f64> {
    let [small, large] = [shape(n), shape(TIMES * n)];
    let begun = worked()?;
    (0..TIMES).for_each(|_| read(&small));
    let between = worked()?;
    read(&large);
    let took = [between - begun, worked()? - between].map(|took| took.max(LEAST));
    Some(took[1].as_secs_f64() / took[0].as_secs_f64())
}

/// Asserts that `read` takes linear time on texts of a shape, which is given its number of parts.
#[track_caller]
pub(crate) fn assert_linear(
    what: &str,
    n: usize,
    shape: &dyn Fn(usize) -> String,
    read: &dyn Fn(&str),
) {
    let mut all = Vec::new();
    for _ in 0..ROUNDS {
        match growth(n, shape, read) {
            None => return println!("skipped: this system does not say what a thread worked"),
            Some(growth) if growth < MOST => return,
            Some(growth) => all.push(growth),
        }
    }
    assert!(
        all.len() < ROUNDS,
        "{what}: ten times the parts took {all:.1?} times as long as ten of a part"
    );
}

#[test]
fn quadratic_work_is_noticed() {
    let words = |n: usize| "word ".repeat(n);
    let quadratic = |text: &str| {
        let words: Vec<&str> = text.split(' ').collect();
        let equal = words
            .iter()
            .map(|a| words.iter().filter(|b| a == *b).count());
        assert!(equal.sum::<usize>() > 0);
    };
    if let Some(growth) = growth(2_000, &words, &quadratic) {
        assert!(growth > MOST, "{growth}");
    }
}
