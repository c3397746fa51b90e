//! The functions of generated code: `bad` is set where one has no finite real value.

#[allow(dead_code)]
mod library {
    // of the C library: `core` has none of them
    extern "C" {
        pub fn sin(x: f64) -> f64;
        pub fn cos(x: f64) -> f64;
        pub fn tan(x: f64) -> f64;
        pub fn asin(x: f64) -> f64;
        pub fn acos(x: f64) -> f64;
        pub fn atan(x: f64) -> f64;
        pub fn sinh(x: f64) -> f64;
        pub fn cosh(x: f64) -> f64;
        pub fn tanh(x: f64) -> f64;
        pub fn asinh(x: f64) -> f64;
        pub fn acosh(x: f64) -> f64;
        pub fn atanh(x: f64) -> f64;
        pub fn exp(x: f64) -> f64;
        pub fn log(x: f64) -> f64;
        pub fn sqrt(x: f64) -> f64;
        pub fn floor(x: f64) -> f64;
        pub fn pow(x: f64, y: f64) -> f64;
        pub fn atan2(y: f64, x: f64) -> f64;
    }
}

pub fn finite(x: f64) -> bool {
    x - x == 0.0
}

/// The absolute value.
pub fn size(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & !(1 << 63))
}

/// The first of two that compare equal, or cannot be compared.
pub fn min(a: f64, b: f64) -> f64 {
    if b < a {
        b
    } else {
        a
    }
}

pub fn max(a: f64, b: f64) -> f64 {
    if b > a {
        b
    } else {
        a
    }
}

pub fn root(x: f64) -> f64 {
    unsafe { library::sqrt(x) }
}

pub fn power(x: f64, y: f64) -> f64 {
    unsafe { library::pow(x, y) }
}

pub fn div(a: f64, b: f64, bad: &mut bool) -> f64 {
    *bad |= b == 0.0;
    a / b
}

fn checked(r: f64, x: f64, bad: &mut bool) -> f64 {
    if !finite(r) {
        *bad |= if r != r { x == x } else { finite(x) };
    }
    r
}

macro_rules! functions {
    ($($name:ident $library:ident),*) => {
        $(pub fn $name(x: f64, bad: &mut bool) -> f64 {
            checked(unsafe { library::$library(x) }, x, bad)
        })*
    };
}

functions!(
    f_sin sin, f_cos cos, f_tan tan, f_asin asin, f_acos acos, f_atan atan, f_sinh sinh, f_cosh cosh, f_tanh tanh,
    f_asinh asinh, f_acosh acosh, f_atanh atanh, f_exp exp, f_log log, f_sqrt sqrt
);

pub fn f_pow(x: f64, y: f64, bad: &mut bool) -> f64 {
    let r = power(x, y);
    *bad |= !finite(r) && finite(x) && finite(y);
    r
}

pub fn f_atan2(y: f64, x: f64, _bad: &mut bool) -> f64 {
    unsafe { library::atan2(y, x) }
}

pub fn f_floor(x: f64, bad: &mut bool) -> f64 {
    *bad |= !finite(x);
    unsafe { library::floor(x) + 0.0 }
}

pub fn f_abs(x: f64, _bad: &mut bool) -> f64 {
    size(x)
}

pub fn f_sign(x: f64, _bad: &mut bool) -> f64 {
    f64::from(i8::from(x > 0.0) - i8::from(x < 0.0))
}

pub fn f_heaviside(x: f64, bad: &mut bool) -> f64 {
    0.5 * (1.0 + f_sign(x, bad))
}

pub fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}
