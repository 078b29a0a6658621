//! PSNR, SSIM and PNG files against numbers and formulas from elsewhere.
//!
//! The constants were computed with NumPy and SciPy on the pictures of [`pictures`]: PSNR as
//! `-10 * log10(mean((a - b)**2))`, SSIM by `scipy.signal.convolve2d(…, mode="valid")` with the separable window
//! `exp(-0.5 * ((arange(11) - 5) / 1.5)**2)`, normalized, and the formula of `src/measure/ssim.rs`. `tools/measure/ssim.py`
//! prints the SSIM of the programs that papers use.

use strivec_format::psnr::psnr_of_mse;
use strivec_measure::{
    DepthCode, Error, PairedDifference, Report, SsimConvention, ViewReport, color_png, depth_png, error_map, mse,
    opacity_png, psnr, ssim,
};

const SIZE: [u32; 2] = [23, 17];
const MSE: f64 = 0.034228911078697785;
const PSNR: f64 = 14.656069168140675;
const SSIM: f64 = 0.8256657331862924;
/// By the code of 3D Gaussian splatting in 64 bits, and by scikit-image 0.25's `structural_similarity` with its defaults.
const SSIM_GAUSSIAN_SPLATTING: f64 = 0.8420124623168466;
const SSIM_SCIKIT_IMAGE: f64 = 0.8154841333397925;
const SSIM_FLAT_AND_RAMP: f64 = 0.26539492783833885;

/// Two pictures of multiples of 1/256, which f32 holds exactly.
fn pictures() -> [Vec<[f32; 3]>; 2] {
    let base = |x: i32, y: i32, c: i32| x * 37 + y * 101 + c * 53 + x * y * 7;
    let offset = |x: i32, y: i32, c: i32| (x * x + 3 * y + c * 11) % 23 - 11;
    let picture = |value: &dyn Fn(i32, i32, i32) -> i32| -> Vec<[f32; 3]> {
        let pixel = |x, y| [0, 1, 2].map(|c| value(x, y, c).rem_euclid(256) as f32 / 256.0);
        (0..SIZE[1] as i32).flat_map(|y| (0..SIZE[0] as i32).map(move |x| pixel(x, y))).collect()
    };
    [picture(&base), picture(&|x, y, c| base(x, y, c) + offset(x, y, c))]
}

fn close(found: f64, expected: f64, tolerance: f64) -> bool {
    (found - expected).abs() <= tolerance
}

/// SSIM with the two-dimensional window written out: every sum of the definition is a loop here, centerd moments
/// instead of differences of squares.
fn brute_force_ssim(size: [u32; 2], a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let (width, height) = (size[0] as usize, size[1] as usize);
    let mut weights = [[0.0f64; 11]; 11];
    for (i, row) in weights.iter_mut().enumerate() {
        for (j, weight) in row.iter_mut().enumerate() {
            let (dy, dx) = (i as f64 - 5.0, j as f64 - 5.0);
            *weight = (-(dx * dx + dy * dy) / (2.0 * 1.5 * 1.5)).exp();
        }
    }
    let total: f64 = weights.iter().flatten().sum();
    let (mut sum, mut count) = (0.0, 0);
    for channel in 0..3 {
        for top in 0..=height - 11 {
            for left in 0..=width - 11 {
                let window = |moment: &dyn Fn(f64, f64) -> f64| {
                    let mut sum = 0.0;
                    for (i, row) in weights.iter().enumerate() {
                        for (j, weight) in row.iter().enumerate() {
                            let at = (top + i) * width + left + j;
                            sum += weight / total * moment(f64::from(a[at][channel]), f64::from(b[at][channel]));
                        }
                    }
                    sum
                };
                let (mean_a, mean_b) = (window(&|p, _| p), window(&|_, q| q));
                let variance_a = window(&|p, _| (p - mean_a).powi(2));
                let variance_b = window(&|_, q| (q - mean_b).powi(2));
                let covariance = window(&|p, q| (p - mean_a) * (q - mean_b));
                sum += (2.0 * mean_a * mean_b + 1e-4) * (2.0 * covariance + 9e-4)
                    / ((mean_a.powi(2) + mean_b.powi(2) + 1e-4) * (variance_a + variance_b + 9e-4));
                count += 1;
            }
        }
    }
    sum / f64::from(count)
}

#[test]
fn psnr_is_numpys() {
    let [a, b] = pictures();
    assert!(close(mse(&a, &b).unwrap(), MSE, 1e-15));
    assert!(close(psnr(&a, &b).unwrap(), PSNR, 1e-11));
}

#[test]
fn ssim_is_scipys_and_the_brute_force() {
    let [a, b] = pictures();
    let found = ssim(SIZE, &a, &b).unwrap();
    assert!(close(found, SSIM, 1e-12), "{found}");
    assert!(close(found, brute_force_ssim(SIZE, &a, &b), 1e-12));
}

#[test]
fn ssim_of_a_flat_picture_and_a_ramp_is_scipys() {
    let flat = vec![[0.25; 3]; (SIZE[0] * SIZE[1]) as usize];
    let ramp: Vec<_> = (0..SIZE[0] * SIZE[1]).map(|i| [(i % SIZE[0]) as f32 / 32.0; 3]).collect();
    let found = ssim(SIZE, &flat, &ramp).unwrap();
    assert!(close(found, SSIM_FLAT_AND_RAMP, 1e-12), "{found}");
    assert!(close(found, brute_force_ssim(SIZE, &flat, &ramp), 1e-10));
}

#[test]
fn each_convention_of_ssim_is_that_of_its_program() {
    let [a, b] = pictures();
    let found = SsimConvention::ALL.map(|convention| convention.mean(SIZE, &a, &b).unwrap());
    for (found, expected) in found.iter().zip([SSIM, SSIM_GAUSSIAN_SPLATTING, SSIM_SCIKIT_IMAGE]) {
        assert!(close(*found, expected, 1e-12), "{found} instead of {expected}");
    }
    assert_eq!(found[0], ssim(SIZE, &a, &b).unwrap(), "the default");
    assert_eq!(SsimConvention::ALL.map(|convention| convention.mean(SIZE, &a, &a).unwrap()).map(f64::round), [1.0; 3]);
    // Windows that reach over the border need no least size.
    let smallest = |convention: SsimConvention| {
        (1..).find(|&n| {
            convention.mean([n, 99], &[[0.5; 3]; 1200][..99 * n as usize], &[[0.5; 3]; 1200][..99 * n as usize]).is_ok()
        })
    };
    assert_eq!(SsimConvention::ALL.map(smallest), [Some(11), Some(1), Some(7)]);
}

#[test]
fn measures_on_request_are_in_the_report_under_their_names() {
    let [a, b] = pictures();
    let measures = [SsimConvention::GaussianSplatting, SsimConvention::ScikitImage];
    let mut view = ViewReport::new("r_0", SIZE, &a, &b, None).unwrap();
    view.add(&measures, SIZE, &a, &b, None).unwrap();
    let mut same = ViewReport::new("r_1", SIZE, &a, &a, None).unwrap();
    same.add(&measures, SIZE, &a, &a, None).unwrap();
    let json = serde_json::to_value(Report::new(vec![view, same]).unwrap()).unwrap();
    assert!(close(json["views"][0]["ssim_3dgs"].as_f64().unwrap(), SSIM_GAUSSIAN_SPLATTING, 1e-12), "{json}");
    assert!(close(json["ssim_skimage"].as_f64().unwrap(), (SSIM_SCIKIT_IMAGE + 1.0) / 2.0, 1e-12), "{json}");
    // Pixels that do not count are identical.
    let mut masked = ViewReport::new("r_2", SIZE, &a, &b, Some(&vec![true; a.len()])).unwrap();
    let mask: Vec<bool> = (0..a.len()).map(|i| i < 40).collect();
    masked.add(&measures, SIZE, &a, &b, Some(&mask)).unwrap();
    assert!(masked.others["ssim_3dgs"] > SSIM_GAUSSIAN_SPLATTING + 0.05, "{masked:?}");
}

#[test]
fn a_difference_that_all_views_share_is_certain() {
    let certain = PairedDifference::new(&[0.5; 9]).unwrap();
    assert_eq!((certain.mean, certain.standard_error), (0.5, Some(0.0)));
    assert_eq!(PairedDifference::new(&[2.0]).unwrap().standard_error, None);
    assert_eq!(PairedDifference::new(&[]), None);
}

#[test]
fn one_changed_pixel_is_seen() {
    let [mut a, b] = pictures();
    let middle = (SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize;
    a[middle][1] += 1.0 / 256.0;
    assert!(!close(mse(&a, &b).unwrap(), MSE, 1e-9));
    assert!(!close(psnr(&a, &b).unwrap(), PSNR, 1e-6));
    assert!(!close(ssim(SIZE, &a, &b).unwrap(), SSIM, 1e-9));
}

#[test]
fn rows_of_another_length_make_another_picture() {
    let [a, b] = pictures();
    let turned = ssim([SIZE[1], SIZE[0]], &a, &b).unwrap();
    assert!(!close(turned, SSIM, 1e-3));
}

#[test]
fn identical_pictures_have_an_infinite_psnr_and_an_ssim_of_1() {
    let [a, _] = pictures();
    assert_eq!(psnr(&a, &a).unwrap(), f64::INFINITY);
    assert!(close(ssim(SIZE, &a, &a).unwrap(), 1.0, 1e-15));
}

#[test]
fn black_against_white_is_0_decibels() {
    let value = psnr(&[[0.0; 3]], &[[1.0; 3]]).unwrap();
    assert_eq!(value, 0.0);
    assert!(value.is_sign_positive());
    assert!(close(psnr_of_mse(0.01), 20.0, 1e-12));
}

#[test]
fn sizes_are_checked() {
    assert!(matches!(psnr(&[[0.0; 3]; 2], &[[0.0; 3]]), Err(Error::Size { expected: 2, found: 1 })));
    assert!(matches!(psnr(&[], &[]), Err(Error::Empty)));
    let small = [[0.0; 3]; 110];
    assert!(matches!(ssim([11, 10], &small, &small), Err(Error::SmallerThanWindow { .. })));
    assert!(matches!(ssim([11, 11], &small, &small), Err(Error::Size { expected: 121, found: 110 })));
}

#[test]
fn a_report_averages_its_views_and_its_json_has_null_for_an_infinite_psnr() {
    let [a, b] = pictures();
    let different = ViewReport::new("r_0", SIZE, &a, &b, None).unwrap();
    let report = Report::new(vec![different.clone(), different.clone()]).unwrap();
    assert!(close(report.psnr, PSNR, 1e-11));
    assert!(close(report.ssim.unwrap(), SSIM, 1e-12));
    let report = Report::new(vec![different, ViewReport::new("r_1", SIZE, &a, &a, None).unwrap()]).unwrap();
    assert_eq!(report.psnr, f64::INFINITY);
    let json: serde_json::Value = serde_json::to_value(&report).unwrap();
    assert_eq!(json["views"][1]["psnr"], serde_json::Value::Null);
    assert_eq!(json["views"][1]["mse"], 0.0);
    assert_eq!(json["views"][0]["name"], "r_0");
    assert_eq!(Report::new(Vec::new()), None);
}

#[test]
fn a_view_smaller_than_the_window_has_no_ssim() {
    let view = ViewReport::new("tiny", [2, 1], &[[0.0; 3]; 2], &[[0.5; 3]; 2], None).unwrap();
    assert_eq!(view.ssim, None);
    assert_eq!(Report::new(vec![view]).unwrap().ssim, None);
}

#[test]
fn colors_are_rounded_half_up_and_clamped() {
    let colors = [[-1.0, 0.0, 0.49 / 255.0], [0.5 / 255.0, 1.0, 2.0], [f32::NAN, 127.5 / 255.0, 254.4 / 255.0]];
    let picture = image::load_from_memory(&color_png([3, 1], &colors).unwrap()).unwrap();
    assert_eq!(picture.color(), image::ColorType::Rgb8);
    assert_eq!(picture.into_rgb8().into_raw(), [0, 0, 0, 1, 255, 255, 0, 128, 254]);
}

#[test]
fn every_8_bit_color_survives() {
    let colors: Vec<[f32; 3]> = (0..=255u8).map(|v| [f32::from(v) / 255.0; 3]).collect();
    let picture = image::load_from_memory(&color_png([16, 16], &colors).unwrap()).unwrap().into_rgb8();
    assert!(picture.pixels().enumerate().all(|(i, pixel)| pixel.0 == [i as u8; 3]));
}

#[test]
fn depths_are_multiples_of_the_unit() {
    let depths = [0.0, 0.001, 1.2344, 65.535, 100.0, f64::NAN];
    let picture =
        image::load_from_memory(&depth_png([2, 3], &depths, DepthCode::Linear { unit: 0.001 }).unwrap()).unwrap();
    assert_eq!(picture.color(), image::ColorType::L16);
    assert_eq!(picture.into_luma16().into_raw(), [0, 1, 1234, 65535, 65535, 0]);
}

#[test]
fn opacities_are_gray_and_wrong_sizes_are_refused() {
    let picture = image::load_from_memory(&opacity_png([2, 1], &[0.0, 1.0]).unwrap()).unwrap();
    assert_eq!(picture.color(), image::ColorType::L8);
    assert_eq!(picture.into_luma8().into_raw(), [0, 255]);
    assert!(matches!(opacity_png([2, 2], &[0.0]), Err(Error::Size { expected: 4, found: 1 })));
    assert!(matches!(color_png([0, 0], &[]), Err(Error::Empty)));
    assert!(matches!(error_map(&[[0.0; 3]], &[], 0.1), Err(Error::Size { expected: 1, found: 0 })));
}
