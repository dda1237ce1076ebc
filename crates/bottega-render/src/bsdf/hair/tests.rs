use super::*;

/// pbrt's values of the model for 200 random fibres and pairs of directions. Planes: β_m, β_n, α in degrees, index of
/// refraction, σ_a (3), h, direction of the viewer (3), direction of the light (3), f times the cosine (3).
const PBRT: &[u8] = include_bytes!("../../../tests/bsdf_laws/golden/pbrt_hair.dat");
const CASES: usize = 200;

struct Case {
    hair: Hair,
    wo: Vec3,
    wi: Vec3,
    scattered: Spectrum,
}

fn cases() -> impl Iterator<Item = Case> {
    let number = |plane: usize, case: usize| {
        let at = 4 * (plane * CASES + case);
        f32::from_le_bytes(PBRT[at..at + 4].try_into().unwrap())
    };
    (0..CASES).map(move |case| {
        let vector = |plane: usize| Vec3::new(number(plane, case), number(plane + 1, case), number(plane + 2, case));
        let params = HairParams {
            sigma_a: vector(4),
            eta: number(3, case),
            beta_m: number(0, case),
            beta_n: number(1, case),
            alpha: number(2, case).to_radians(),
            h: Some(number(7, case)),
        };
        Case { hair: Hair::new(&params), wo: vector(8), wi: vector(11), scattered: vector(14) }
    })
}

/// M as pbrt computes it: I₀ by ten terms of its series up to 12, where they are 1.6 % too low, and beyond by an expansion
/// with half of its second term, which is 0.5 % too low there.
fn longitudinal_of_pbrt(angles: &Inclinations, v: f32) -> f32 {
    let Inclinations { sin_i, cos_i, sin_o, cos_o } = *angles;
    let v = f64::from(v);
    let (a, b) = (f64::from(cos_i * cos_o) / v, f64::from(sin_i * sin_o) / v);
    let series = |x: f64| {
        let mut term = 1.0;
        (1..10).fold(1.0, |sum, i| {
            term *= 0.25 * x * x / f64::from(i * i);
            sum + term
        })
    };
    let log = if a > 12.0 { a - 0.5 * (2.0 * std::f64::consts::PI * a).ln() + 0.5 / (8.0 * a) } else { series(a).ln() };
    ((log - b - 1.0 / v).exp() / (v * (1.0 - (-2.0 / v).exp()))) as f32
}

#[test]
fn values_are_those_of_pbrt() {
    let mut same = 0;
    for (index, Case { hair, wo, wi, scattered }) in cases().enumerate() {
        let (by_series, _) = hair.scattered(wo, wi, longitudinal_of_pbrt);
        let (value, pdf) = hair.scattered(wo, wi, longitudinal);
        for channel in 0..3 {
            let expected = scattered[channel];
            assert!(
                (by_series[channel] - expected).abs() <= 1e-3 * expected + 1e-9,
                "{index}: {by_series} {scattered}"
            );
            assert!((value[channel] - expected).abs() <= 0.017 * expected + 1e-9, "{index}: {value} {scattered}");
            same += u32::from((value[channel] - expected).abs() <= 1e-3 * expected + 1e-9);
        }
        assert!(pdf > 0.0, "{index}");
    }
    assert!(same > 500, "5 of 6 are the same without the errors of pbrt's I₀: {same} of 600");
}

#[test]
fn the_bessel_function_has_the_values_of_tables() {
    // exp(−x) I₀(x), as NumPy's `i0` has it
    for (x, expected) in
        [(0.0, 1.0), (0.5, 0.645_035_27), (2.0, 0.308_508_3), (3.8, 0.212_900_15), (10.0, 0.127_833_34)]
    {
        assert!((bessel_i0_scaled(x) - expected).abs() < 1e-5 * expected, "{x}: {}", bessel_i0_scaled(x));
    }
}

#[test]
fn each_distribution_is_one_in_sum() {
    let steps = 20_000;
    let middle = |i: i32| (i as f32 + 0.5) / steps as f32;
    for beta in [0.05, 0.1, 0.3, 0.6, 1.0] {
        let hair = Hair::new(&HairParams {
            sigma_a: Spectrum::ZERO,
            eta: 1.55,
            beta_m: beta,
            beta_n: beta,
            alpha: 0.0,
            h: Some(0.0),
        });
        let around = (0..steps).map(|i| f64::from(trimmed_logistic(2.0 * PI * middle(i), hair.scale))).sum::<f64>();
        assert!((around * std::f64::consts::TAU / f64::from(steps) - 1.0).abs() < 1e-3, "{beta}: {around}");
        for (v, sin_o) in hair.variance.into_iter().flat_map(|v| [-0.9_f32, 0.0, 0.5].map(|sin| (v, sin))) {
            let cos_o = (1.0 - sin_o * sin_o).sqrt();
            // ∫ M cos θ dθ = ∫ M d sin θ
            let sum = (0..steps).map(|i| {
                let sin_i = 2.0 * middle(i) - 1.0;
                let cos_i = (1.0 - sin_i * sin_i).sqrt();
                f64::from(longitudinal(&Inclinations { sin_i, cos_i, sin_o, cos_o }, v))
            });
            let sum = 2.0 * sum.sum::<f64>() / f64::from(steps);
            assert!((sum - 1.0).abs() < 2e-3, "{beta} {v} {sin_o}: {sum}");
        }
    }
}

#[test]
fn the_normal_of_a_round_fibre_says_where_light_meets_it() {
    let params = HairParams {
        sigma_a: Spectrum::new(0.1, 0.3, 0.9),
        eta: 1.55,
        beta_m: 0.2,
        beta_n: 0.25,
        alpha: 0.04,
        h: None,
    };
    let round = Hair::new(&params);
    for h in [-0.9f32, -0.4, 0.0, 0.7] {
        let flat = Hair::new(&HairParams { h: Some(h), ..params });
        // The cross-section turned about the fibre, so that z is the normal of the round fibre
        let turn = glam::Quat::from_rotation_x(h.asin());
        let (wo, wi) = (Vec3::new(0.3, 0.0, 0.8).normalize(), Vec3::new(-0.5, 0.6, 0.2).normalize());
        let (at_normal, at_offset) =
            (round.scattered(turn * wo, turn * wi, longitudinal), flat.scattered(wo, wi, longitudinal));
        assert!((at_normal.0 - at_offset.0).abs().max_element() < 1e-4 * at_offset.0.max_element(), "{h}");
        // A smooth fibre reflects as a mirror with that normal does
        let mirrored = Vec3::new(0.0, (2.0 * h.asin()).sin(), (2.0 * h.asin()).cos());
        let other = Vec3::new(0.0, -mirrored.y, mirrored.z);
        let sharp = Hair::new(&HairParams { beta_m: 0.05, beta_n: 0.05, alpha: 0.0, h: Some(h), ..params });
        let along = |wi: Vec3| sharp.scattered(Vec3::Z, wi, longitudinal).0.x;
        assert!(h == 0.0 || along(mirrored) > 2.0 * along(other), "{h}: the normal leans to +y for h above 0");
    }
}

#[test]
fn reflectances_and_pigments_become_absorption() {
    // Chiang et al. 2016, eq. 9 at β_n = 0.3: the fit is 5.969 − 0.0645 + 0.22788 − 0.28971 + 0.04515 + 0.0006.
    let fit = 5.888_4_f32;
    let sigma_a = sigma_a_of_reflectance(Spectrum::new(1.0, 0.5, 0.1), 0.3);
    let expected = [0.0, (0.5f32.ln() / fit).powi(2), (0.1f32.ln() / fit).powi(2)];
    assert!((0..3).all(|i| (sigma_a[i] - expected[i]).abs() < 1e-4 * expected[i].max(1e-3)), "{sigma_a} {expected:?}");
    assert!(sigma_a_of_reflectance(Spectrum::ZERO, 0.3).is_finite());
    let sigma_a = sigma_a_of_melanin(2.0, 1.0);
    assert!((sigma_a - Spectrum::new(1.025, 1.794, 3.79)).abs().max_element() < 1e-6);
}

#[test]
fn fibres_at_the_limits_of_their_parameters_have_finite_values() {
    let extremes = [0.0, 1.0];
    for (beta_m, beta_n, eta, h) in extremes
        .iter()
        .flat_map(|m| extremes.iter().flat_map(move |n| [1.0, 20.0, 0.06].map(|eta| (*m, *n, eta))))
        .flat_map(|(m, n, eta)| [None, Some(-1.0), Some(0.0), Some(1.0)].map(|h| (m, n, eta, h)))
    {
        for sigma_a in [0.0, 1e6] {
            let sigma_a = Spectrum::splat(sigma_a);
            let hair = Hair::new(&HairParams { sigma_a, eta, beta_m, beta_n, alpha: 1.5, h });
            for wo in
                [Vec3::Z, Vec3::X, Vec3::new(0.999_999, 0.0, 1e-3).normalize(), Vec3::new(0.0, 1.0, 1e-3).normalize()]
            {
                for u in [0.0, 0.3, 0.999_999_9] {
                    let sample = hair.sample(wo, u, [u, 1.0 - u], TransportMode::Radiance);
                    assert!(
                        sample.is_none_or(|s| s.weight().is_finite() && s.wi.is_finite()),
                        "{hair:?} {wo} {sample:?}"
                    );
                }
                let (value, pdf) = hair.eval_pdf(wo, Vec3::new(0.1, -0.7, -0.6).normalize(), TransportMode::Radiance);
                assert!(value.is_finite() && value.min_element() >= 0.0 && pdf.is_finite(), "{hair:?} {wo}");
            }
        }
    }
}
