//! What is asserted of every reader.

/// How far an input led.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// It was refused.
    Refused,
    /// It was read.
    Read,
    /// It was read, and led to a place that no seed leads to: the feature `planted` has a bug there.
    Planted,
}

impl Reached {
    pub(crate) fn read(is_planted: bool) -> Self {
        if is_planted { Self::Planted } else { Self::Read }
    }
}

/// The memory that reading may allocate, all in all and not at once: each allocation is work too.
#[derive(Clone, Copy, Debug)]
pub struct Allowed {
    /// Bytes for any input.
    pub bytes: u64,
    /// Bytes for each byte of the input.
    pub per_byte: u64,
}

/// One kind of input, and its reader.
pub struct Target {
    pub name: &'static str,
    pub allowed: Allowed,
    /// Reads an input, and asserts what must hold of what it has read.
    pub read: fn(&[u8]) -> Reached,
    /// Inputs to begin with, each of a name: what our own encoders write, and our own files.
    pub seeds: fn() -> Vec<(&'static str, Vec<u8>)>,
}

impl Target {
    /// Reads an input within what is allowed; gives how far it led, and the bytes that were allocated.
    ///
    /// # Panics
    /// When something that must hold does not.
    pub fn check(&self, input: &[u8]) -> (Reached, u64) {
        let mut reached = Reached::Refused;
        let spent = allocation_counter::measure(|| reached = (self.read)(input)).bytes_total;
        let Allowed { bytes, per_byte } = self.allowed;
        let allowed = bytes + per_byte * input.len() as u64;
        let length = input.len();
        assert!(
            spent <= allowed,
            "{}: {length} bytes made it allocate {spent}: expected {allowed} at most",
            self.name
        );
        (reached, spent)
    }

    /// The same for the program of the fuzzer, which also looks at the time that it takes.
    ///
    /// # Panics
    /// When something that must hold does not.
    #[cfg(feature = "libfuzzer")]
    pub fn run(&self, input: &[u8]) {
        let before = processor_time();
        let (reached, _) = self.check(input);
        let took = processor_time().saturating_sub(before);
        let allowed = MOST + MOST_PER_BYTE * u32::try_from(input.len()).unwrap_or(u32::MAX);
        assert!(took <= allowed, "{}: {} bytes took {took:?}", self.name, input.len());
        assert!(!cfg!(feature = "planted") || reached != Reached::Planted, "{}: the planted bug", self.name);
    }
}

/// The time of a processor that any input may take, built as a fuzzer; gross, for what no allocation shows.
#[cfg(feature = "libfuzzer")]
const MOST: std::time::Duration = std::time::Duration::from_millis(300);
#[cfg(feature = "libfuzzer")]
const MOST_PER_BYTE: std::time::Duration = std::time::Duration::from_micros(20);

/// The time that this thread has spent on a processor.
#[cfg(feature = "libfuzzer")]
fn processor_time() -> std::time::Duration {
    nix::time::clock_gettime(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID)
        .expect("the thread has a clock")
        .into()
}
