//! Vector instruction sets: which ones exist, which one a process uses, and how code is compiled for each.

pub use lanes::Lanes;
use lanes::Plain;
#[cfg(target_arch = "x86_64")]
use lanes::Wide;
use std::sync::OnceLock;

mod lanes;

/// A vector instruction set that the kernel is compiled for.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::instructions::InstructionSet;
///
/// let sets = InstructionSet::available();
/// assert_eq!(sets[0], InstructionSet::Baseline);
/// assert_eq!(sets[0].name(), "baseline");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// The instructions that every processor of this architecture has.
    ///
    /// On x86-64 that is SSE2: two numbers at a time and no fused multiply-add.
    Baseline,
    /// AVX2 and FMA: four numbers at a time.
    Avx2,
    /// AVX-512 (F, DQ, VL): eight numbers at a time.
    Avx512,
}

impl InstructionSet {
    /// All sets, narrowest first.
    pub const ALL: [InstructionSet; 3] =
        [InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512];

    /// The sets that this processor can run, narrowest first.
    pub fn available() -> Vec<InstructionSet> {
        let mut sets = vec![InstructionSet::Baseline];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            sets.push(InstructionSet::Avx2);
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
            {
                sets.push(InstructionSet::Avx512);
            }
        }
        sets
    }

    /// The set to use: the one that the environment variable `DEMHYBRID_INSTRUCTIONS` names, else the widest
    /// that this processor can run.
    ///
    /// A name that this processor cannot run is an error, whose text says so.
    pub fn chosen() -> Result<Self, String> {
        let sets = Self::available();
        let Some(wanted) = std::env::var_os("DEMHYBRID_INSTRUCTIONS") else {
            return Ok(*sets.last().expect("there is a baseline"));
        };
        let known = sets.iter().find(|set| wanted == set.name());
        known.copied().ok_or_else(|| {
            let names: Vec<&str> = sets.iter().map(|set| set.name()).collect();
            let wanted = wanted.to_string_lossy();
            format!("DEMHYBRID_INSTRUCTIONS = \"{wanted}\": this processor runs {}", names.join(", "))
        })
    }

    /// Name of the set in `DEMHYBRID_INSTRUCTIONS` and in the output file.
    pub fn name(self) -> &'static str {
        match self {
            InstructionSet::Baseline => "baseline",
            InstructionSet::Avx2 => "avx2",
            InstructionSet::Avx512 => "avx512",
        }
    }
}

/// Work that is compiled for every instruction set, for [`run`].
pub trait Vectorised {
    /// What the work returns.
    type Output;
    /// Does the work. It must be inlined: only then is it compiled with the instructions of its caller.
    fn work<L: Lanes>(self) -> Self::Output;
}

/// Does `job` with the set that [`InstructionSet::chosen`] gives on this process, or with the baseline where
/// that fails. The job must give the same bits with every set, because ranks do not agree on this one.
pub fn run_widest<J: Vectorised>(job: J) -> J::Output {
    static SET: OnceLock<InstructionSet> = OnceLock::new();
    run(*SET.get_or_init(|| InstructionSet::chosen().unwrap_or(InstructionSet::Baseline)), job)
}

/// Does `job` with the instructions of `set`, which this processor must have.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // Calling a function compiled for further instructions is unsafe.
pub fn run<J: Vectorised>(set: InstructionSet, job: J) -> J::Output {
    #[target_feature(enable = "avx2,fma")]
    fn avx2<J: Vectorised>(job: J) -> J::Output {
        job.work::<Wide>()
    }
    #[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
    fn avx512<J: Vectorised>(job: J) -> J::Output {
        job.work::<Wide>()
    }
    match set {
        InstructionSet::Baseline => job.work::<Plain>(),
        // SAFETY: this processor has the instructions: the caller passes a set from
        // `InstructionSet::available`, or a narrower one.
        InstructionSet::Avx2 => unsafe { avx2(job) },
        // SAFETY: the same.
        InstructionSet::Avx512 => unsafe { avx512(job) },
    }
}

/// Does `job`. This architecture has a single instruction set.
#[cfg(not(target_arch = "x86_64"))]
pub fn run<J: Vectorised>(_set: InstructionSet, job: J) -> J::Output {
    job.work::<Plain>()
}
