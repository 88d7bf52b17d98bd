//! SIMD arithmetic on eight numbers at a time.
//!
//! Every operation rounds each number separately, and sums over the eight have a fixed order, so that all implementations give the same
//! bits. The implementations with intrinsics exist because compilers keep arrays of eight numbers in memory, not in
//! registers, if masks select among the numbers.

use std::ops::{Add, Div, Mul, Sub};

/// Eight numbers in memory, aligned to the widest register.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(align(64))]
pub(crate) struct Eight(pub [f64; 8]);

impl Eight {
    /// Eight zeros.
    pub const ZERO: Self = Self([0.0; 8]);

    /// Returns the number of blocks of eight that hold `count` numbers.
    pub fn blocks(count: usize) -> usize {
        count.div_ceil(8)
    }

    /// Copies numbers into blocks, and pads the last block with `fill`.
    pub fn spread(values: impl Iterator<Item = f64>, fill: f64, blocks: &mut [Self]) {
        let flat = blocks.iter_mut().flat_map(|block| &mut block.0);
        flat.zip(values.chain(std::iter::repeat(fill))).for_each(|(to, value)| *to = value);
    }
}

/// Returns the values of a function at 0 and 1. Unlike `map` on an array it is always inlined, so SIMD values stay in
/// registers.
#[inline(always)]
pub(crate) fn both<T>(of: impl Fn(usize) -> T) -> [T; 2] {
    [of(0), of(1)]
}

/// Adding and subtracting this rounds to the nearest integer (1.5·2⁵²).
pub(crate) const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Arithmetic that is shared by one number and by eight numbers in registers.
pub(crate) trait Numbers:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Returns `value`, repeated for eight numbers.
    fn from_number(value: f64) -> Self;
    /// Returns the square root of each number.
    fn square_root(self) -> Self;
}

impl Numbers for f64 {
    #[inline(always)]
    fn from_number(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn square_root(self) -> Self {
        self.sqrt()
    }
}

impl<L: Octet> Numbers for L {
    #[inline(always)]
    fn from_number(value: f64) -> Self {
        L::splat(value)
    }
    #[inline(always)]
    fn square_root(self) -> Self {
        self.sqrt()
    }
}

/// Eight numbers in registers. A mask has bit `i` set where number `i` is selected.
pub(crate) trait Octet:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Reads eight numbers.
    fn load(from: &Eight) -> Self;
    /// Writes eight numbers.
    fn store(self, to: &mut Eight);
    /// Reads eight numbers of any alignment.
    fn read(from: &[f64; 8]) -> Self;
    /// Writes eight numbers of any alignment.
    fn write(self, to: &mut [f64; 8]);
    /// Eight equal numbers.
    fn splat(value: f64) -> Self;
    /// Magnitudes.
    fn abs(self) -> Self;
    /// Square roots.
    fn sqrt(self) -> Self;
    /// The larger numbers; the second where one is NaN.
    fn max(self, other: Self) -> Self;
    /// The smaller numbers; the second where one is NaN.
    fn min(self, other: Self) -> Self;
    /// Mask of the numbers that are smaller than those of `other`.
    fn less(self, other: Self) -> u8;
    /// Numbers of `chosen` where the mask is set, otherwise those of `other`.
    fn select(mask: u8, chosen: Self, other: Self) -> Self;
    /// 2^k for numbers `1.5·2⁵² + k`.
    fn power_of_two(shifted: Self) -> Self;

    /// Eight zeros.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    /// Returns the eight numbers as an array.
    #[inline(always)]
    fn array(self) -> [f64; 8] {
        let mut out = Eight::ZERO;
        self.store(&mut out);
        out.0
    }
    /// Sum of the eight numbers: adds the upper half to the lower half until one number remains.
    #[inline(always)]
    fn total(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.array();
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }
    /// The nearest integers, for magnitudes below 2⁵¹.
    #[inline(always)]
    fn rounded(self) -> Self {
        (self + Self::splat(ROUNDER)) - Self::splat(ROUNDER)
    }
    /// e^x for x ≤ 0, within two units in the last place; e^(−700) below −700.
    ///
    /// Cody-Waite reduction x = k ln 2 + r with |r| ≤ ½ ln 2, Taylor polynomial of degree 13 in two parts, scaling by exponent bits.
    #[inline(always)]
    fn exp_of_negative(self) -> Self {
        let x = self.max(Self::splat(-700.0));
        let shifted = x * Self::splat(std::f64::consts::LOG2_E) + Self::splat(ROUNDER);
        let k = shifted - Self::splat(ROUNDER);
        let r = (x - k * Self::splat(LN2_HIGH)) - k * Self::splat(LN2_LOW);
        let square = r * r;
        let (mut odd, mut even) = (Self::splat(INVERSE_FACTORIALS[13]), Self::splat(INVERSE_FACTORIALS[12]));
        for pair in 1..7 {
            odd = odd * square + Self::splat(INVERSE_FACTORIALS[13 - 2 * pair]);
            even = even * square + Self::splat(INVERSE_FACTORIALS[12 - 2 * pair]);
        }
        (odd * r + even) * Self::power_of_two(shifted)
    }
}

/// ln 2 as the sum of two parts. The first part has few significant bits.
pub(crate) const LN2_HIGH: f64 = 0.693_147_180_369_123_8;
pub(crate) const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// 1/n!.
pub(crate) const INVERSE_FACTORIALS: [f64; 14] = [
    1.0,
    1.0,
    0.5,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];

/// Loops over blocks of eight numbers that are compiled once per instruction set. `run` must be `#[inline(always)]`.
pub(crate) trait OctetKernel {
    /// Result of the loops.
    type Output;
    /// Runs the loops.
    fn run<L: Octet>(self) -> Self::Output;
}

/// Eight numbers in an array, for processors without a supported instruction set.
#[derive(Clone, Copy)]
pub(crate) struct Portable([f64; 8]);

macro_rules! portable_operator {
    ($name:ident, $call:ident, $operator:tt) => {
        impl $name for Portable {
            type Output = Self;
            #[inline(always)]
            fn $call(self, other: Self) -> Self {
                self.with(other, |a, b| a $operator b)
            }
        }
    };
}
portable_operator!(Add, add, +);
portable_operator!(Sub, sub, -);
portable_operator!(Mul, mul, *);
portable_operator!(Div, div, /);

impl Portable {
    #[inline(always)]
    fn with(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = [0.0; 8];
        for i in 0..8 {
            out[i] = of(self.0[i], other.0[i]);
        }
        Self(out)
    }
}

impl Octet for Portable {
    #[inline(always)]
    fn load(from: &Eight) -> Self {
        Self(from.0)
    }
    #[inline(always)]
    fn store(self, to: &mut Eight) {
        to.0 = self.0;
    }
    #[inline(always)]
    fn read(from: &[f64; 8]) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn write(self, to: &mut [f64; 8]) {
        *to = self.0;
    }
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn less(self, other: Self) -> u8 {
        let bits = self.0.iter().zip(&other.0).enumerate();
        bits.fold(0, |mask, (i, (a, b))| mask | u8::from(a < b) << i)
    }
    #[inline(always)]
    fn select(mask: u8, chosen: Self, other: Self) -> Self {
        Self(std::array::from_fn(|i| if mask >> i & 1 == 1 { chosen.0[i] } else { other.0[i] }))
    }
    #[inline(always)]
    fn power_of_two(shifted: Self) -> Self {
        Self(shifted.0.map(|value| f64::from_bits((value.to_bits() << 52).wrapping_add(1023 << 52))))
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) mod wide {
    //! Eight numbers in the registers of AVX2 and AVX-512. Values of these types are made only inside functions that
    //! [`InstructionSet::run_octets`](crate::math::simd::InstructionSet::run_octets) calls after the processor reported the feature.

    use super::{Eight, Octet, both};
    use std::arch::x86_64::{
        __m256d, __m256i, __m512d, _CMP_LT_OQ, _mm256_add_epi64, _mm256_add_pd, _mm256_and_pd, _mm256_and_si256,
        _mm256_blendv_pd, _mm256_castpd_si256, _mm256_castsi256_pd, _mm256_cmp_pd, _mm256_cmpeq_epi64, _mm256_div_pd,
        _mm256_load_pd, _mm256_loadu_pd, _mm256_max_pd, _mm256_min_pd, _mm256_movemask_pd, _mm256_mul_pd,
        _mm256_set1_epi64x, _mm256_set1_pd, _mm256_setr_epi64x, _mm256_slli_epi64, _mm256_sqrt_pd, _mm256_store_pd,
        _mm256_storeu_pd, _mm256_sub_pd, _mm512_abs_pd, _mm512_add_epi64, _mm512_add_pd, _mm512_castpd_si512,
        _mm512_castsi512_pd, _mm512_cmp_pd_mask, _mm512_div_pd, _mm512_load_pd, _mm512_loadu_pd, _mm512_mask_blend_pd,
        _mm512_max_pd, _mm512_min_pd, _mm512_mul_pd, _mm512_set1_epi64, _mm512_set1_pd, _mm512_slli_epi64,
        _mm512_sqrt_pd, _mm512_store_pd, _mm512_storeu_pd, _mm512_sub_pd,
    };
    use std::ops::{Add, Div, Mul, Sub};

    /// Eight numbers in one register of AVX-512.
    #[derive(Clone, Copy)]
    pub(crate) struct Avx512(__m512d);

    /// Eight numbers in two registers of AVX2.
    #[derive(Clone, Copy)]
    pub(crate) struct Avx2([__m256d; 2]);

    /// Defines a method of one instruction, on one register or on each of two.
    macro_rules! instruction {
        (one $name:ident($($other:ident)?) $instruction:ident) => {
            #[inline(always)]
            fn $name(self $(, $other: Self)?) -> Self {
                // SAFETY: see the module.
                Self(unsafe { $instruction(self.0 $(, $other.0)?) })
            }
        };
        (two $name:ident($($other:ident)?) $instruction:ident) => {
            #[inline(always)]
            fn $name(self $(, $other: Self)?) -> Self {
                // SAFETY: see the module.
                Self(both(|half| unsafe { $instruction(self.0[half] $(, $other.0[half])?) }))
            }
        };
    }

    macro_rules! operator {
        ($name:ident, $call:ident, $long:ident, $short:ident) => {
            impl $name for Avx512 {
                type Output = Self;
                instruction!(one $call(other) $long);
            }
            impl $name for Avx2 {
                type Output = Self;
                instruction!(two $call(other) $short);
            }
        };
    }
    operator!(Add, add, _mm512_add_pd, _mm256_add_pd);
    operator!(Sub, sub, _mm512_sub_pd, _mm256_sub_pd);
    operator!(Mul, mul, _mm512_mul_pd, _mm256_mul_pd);
    operator!(Div, div, _mm512_div_pd, _mm256_div_pd);

    impl Octet for Avx512 {
        instruction!(one abs() _mm512_abs_pd);
        instruction!(one sqrt() _mm512_sqrt_pd);
        instruction!(one max(other) _mm512_max_pd);
        instruction!(one min(other) _mm512_min_pd);
        #[inline(always)]
        fn load(from: &Eight) -> Self {
            // SAFETY: see the module; `Eight` is aligned to 64 bytes.
            Self(unsafe { _mm512_load_pd(from.0.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, to: &mut Eight) {
            // SAFETY: see the module; `Eight` is aligned to 64 bytes.
            unsafe { _mm512_store_pd(to.0.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn read(from: &[f64; 8]) -> Self {
            // SAFETY: see the module.
            Self(unsafe { _mm512_loadu_pd(from.as_ptr()) })
        }
        #[inline(always)]
        fn write(self, to: &mut [f64; 8]) {
            // SAFETY: see the module.
            unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: see the module.
            Self(unsafe { _mm512_set1_pd(value) })
        }
        #[inline(always)]
        fn less(self, other: Self) -> u8 {
            // SAFETY: see the module.
            unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0) }
        }
        #[inline(always)]
        fn select(mask: u8, chosen: Self, other: Self) -> Self {
            // SAFETY: see the module.
            Self(unsafe { _mm512_mask_blend_pd(mask, other.0, chosen.0) })
        }
        #[inline(always)]
        fn power_of_two(shifted: Self) -> Self {
            // SAFETY: see the module.
            Self(unsafe {
                let exponent = _mm512_slli_epi64::<52>(_mm512_castpd_si512(shifted.0));
                _mm512_castsi512_pd(_mm512_add_epi64(exponent, _mm512_set1_epi64(1023 << 52)))
            })
        }
    }

    /// Expands a mask to numbers in which either all bits or no bits are set.
    #[inline(always)]
    fn spread(mask: u8) -> [__m256d; 2] {
        // SAFETY: see the module.
        unsafe {
            let (all, low, high) = (
                _mm256_set1_epi64x(i64::from(mask)),
                _mm256_setr_epi64x(1, 2, 4, 8),
                _mm256_setr_epi64x(16, 32, 64, 128),
            );
            let of = |bits: __m256i| _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(all, bits), bits));
            [of(low), of(high)]
        }
    }

    impl Octet for Avx2 {
        instruction!(two sqrt() _mm256_sqrt_pd);
        instruction!(two max(other) _mm256_max_pd);
        instruction!(two min(other) _mm256_min_pd);
        #[inline(always)]
        fn load(from: &Eight) -> Self {
            let (halves, _) = from.0.as_chunks::<4>();
            // SAFETY: see the module; both halves of `Eight` are aligned to 32 bytes.
            Self(both(|half| unsafe { _mm256_load_pd(halves[half].as_ptr()) }))
        }
        #[inline(always)]
        fn store(self, to: &mut Eight) {
            let (halves, _) = to.0.as_chunks_mut::<4>();
            for half in [0, 1] {
                // SAFETY: see the module; both halves of `Eight` are aligned to 32 bytes.
                unsafe { _mm256_store_pd(halves[half].as_mut_ptr(), self.0[half]) }
            }
        }
        #[inline(always)]
        fn read(from: &[f64; 8]) -> Self {
            let (halves, _) = from.as_chunks::<4>();
            // SAFETY: see the module.
            Self(both(|half| unsafe { _mm256_loadu_pd(halves[half].as_ptr()) }))
        }
        #[inline(always)]
        fn write(self, to: &mut [f64; 8]) {
            let (halves, _) = to.as_chunks_mut::<4>();
            for half in [0, 1] {
                // SAFETY: see the module.
                unsafe { _mm256_storeu_pd(halves[half].as_mut_ptr(), self.0[half]) }
            }
        }
        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: see the module.
            Self([unsafe { _mm256_set1_pd(value) }; 2])
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see the module.
            Self(both(|half| unsafe {
                _mm256_and_pd(self.0[half], _mm256_castsi256_pd(_mm256_set1_epi64x(0x7fff_ffff_ffff_ffff)))
            }))
        }
        #[inline(always)]
        fn less(self, other: Self) -> u8 {
            // SAFETY: see the module.
            let [low, high] =
                both(|half| unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0[half], other.0[half])) });
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "eight bits")]
            let mask = (low | high << 4) as u8;
            mask
        }
        #[inline(always)]
        fn select(mask: u8, chosen: Self, other: Self) -> Self {
            let mask = spread(mask);
            // SAFETY: see the module.
            Self(both(|half| unsafe { _mm256_blendv_pd(other.0[half], chosen.0[half], mask[half]) }))
        }
        #[inline(always)]
        fn power_of_two(shifted: Self) -> Self {
            // SAFETY: see the module.
            Self(both(|half| unsafe {
                let exponent = _mm256_slli_epi64::<52>(_mm256_castpd_si256(shifted.0[half]));
                _mm256_castsi256_pd(_mm256_add_epi64(exponent, _mm256_set1_epi64x(1023 << 52)))
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::InstructionSet;

    /// Applies every operation to some numbers and collects the bits of the results.
    struct Operations {
        one: Eight,
        other: Eight,
    }

    impl OctetKernel for Operations {
        type Output = Vec<u64>;
        #[inline(always)]
        fn run<L: Octet>(self) -> Vec<u64> {
            let (a, b) = (L::load(&self.one), L::load(&self.other));
            let (mask, mut shifted) = (a.less(b), [0.0; 9]);
            // Not aligned.
            let (_, unaligned) = shifted.split_first_chunk_mut::<1>().expect("nine numbers");
            let unaligned: &mut [f64; 8] = unaligned.try_into().expect("eight numbers");
            (a * b).write(unaligned);
            let all = [
                L::read(unaligned),
                a + b,
                a - b,
                a * b,
                a / b,
                a.abs().sqrt(),
                a.max(b),
                a.min(b),
                L::select(mask, a, b),
                a.rounded(),
                (L::zero() - a.abs()).exp_of_negative(),
                L::splat(a.total()),
                L::splat(f64::from(mask)),
            ];
            all.into_iter().flat_map(|one| one.array().map(f64::to_bits)).collect()
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let special = [0.0, -0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE, -3.5];
        for turn in 0..1000_u32 {
            let number = |i: usize| (f64::from(turn) + 0.37 * i as f64).sin() * f64::from(turn % 41) * 20.0;
            let mut one = Eight(std::array::from_fn(number));
            let other = Eight(std::array::from_fn(|i| number(i + 3) + 0.1));
            if turn % 7 == 0 {
                one.0[turn as usize % 8] = special[turn as usize / 7 % 8];
            }
            let sets = [InstructionSet::Baseline, InstructionSet::detect()];
            let [first, second] = sets.map(|set| set.run_octets(Operations { one, other }));
            let is_same = |(a, b): (&u64, &u64)| a == b || f64::from_bits(*a).is_nan() && f64::from_bits(*b).is_nan();
            assert!(first.iter().zip(&second).all(is_same), "{one:?} {other:?}");
            #[cfg(target_arch = "x86_64")]
            if InstructionSet::detect() != InstructionSet::Baseline {
                let third = InstructionSet::Avx2.run_octets(Operations { one, other });
                assert!(first.iter().zip(&third).all(is_same), "{one:?} {other:?}");
            }
        }
    }

    #[test]
    fn the_exponential_is_within_two_ulp_of_the_library() {
        for i in 0..100_000 {
            let x = -f64::from(i) * 6.98e-3;
            let (found, expected) = (Portable::splat(x).exp_of_negative().array()[0], libm::exp(x));
            assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected, "e^{x}: {found:e} vs {expected:e}");
        }
    }
}
