use super::*;

const K: [f64; 4] = [1261.5, 1147.0, 976.2, 530.6];
const POINTS: [[f64; 3]; 6] = [
    [0.5, 0.3, 4.0],
    [-2.0, 1.1, 6.5],
    [3.0, 1.4, 7.0],
    [-6.0, 1.5, 9.0],
    [0.0, 0.0, 5.0],
    [1.2, -0.8, 2.5],
];
const PLUMB_BOB: Lens = Lens::PlumbBob([-0.404, 0.149, 0.00106, 0.0005, -0.021]);
const RATIONAL: Lens =
    Lens::RationalPolynomial([0.31, -0.12, 0.0011, -0.0007, 0.013, 0.68, -0.03, 0.02]);
const FISHEYE: Lens = Lens::KannalaBrandt([-0.021, 0.0043, -0.0017, 0.0002]);

fn camera(lens: Lens) -> Camera {
    Camera {
        k: K,
        lens,
        ..Camera::ahead(1920, 1080, 1.3)
    }
}

/// `cv2.projectPoints` and `cv2.fisheye.projectPoints` of OpenCV 5.0.0.
#[test]
fn points_are_seen_where_opencv_sees_them() {
    let opencv: [(Lens, [[f64; 2]; 6]); 4] = [
        (
            Lens::Pinhole,
            [
                [1133.887500, 616.625000],
                [588.046154, 724.707692],
                [1516.842857, 760.000000],
                [135.200000, 721.766667],
                [976.200000, 530.600000],
                [1581.720000, 163.560000],
            ],
        ),
        (
            PLUMB_BOB,
            [
                [1132.602517, 615.942513],
                [606.577260, 715.629494],
                [1472.493323, 741.394147],
                [270.122095, 691.739535],
                [976.200000, 530.600000],
                [1509.920851, 207.613400],
            ],
        ),
        (
            RATIONAL,
            [
                [1132.638657, 615.980753],
                [604.466643, 716.597276],
                [1475.527384, 742.835461],
                [258.593838, 694.219182],
                [976.200000, 530.600000],
                [1514.602763, 204.485319],
            ],
        ),
        (
            FISHEYE,
            [
                [1132.715967, 615.985881],
                [603.789543, 716.834750],
                [1479.213071, 744.033317],
                [244.612071, 696.896344],
                [976.200000, 530.600000],
                [1522.422575, 199.503531],
            ],
        ),
    ];
    for (lens, pixels) in opencv {
        for (point, expected) in POINTS.into_iter().zip(pixels) {
            let pixel = camera(lens).pixel(point).unwrap();
            let miss_px = (pixel[0] - expected[0]).hypot(pixel[1] - expected[1]);
            assert!(miss_px < 1e-5, "{lens:?} {point:?}: {pixel:?}");
        }
    }
}

#[test]
fn the_ray_of_a_pixel_is_seen_at_that_pixel() {
    for lens in [Lens::Pinhole, PLUMB_BOB, RATIONAL, FISHEYE] {
        let camera = camera(lens);
        for pixel in [
            [976.2, 530.6],
            [400.0, 300.0],
            [1500.0, 900.0],
            [976.0, 1000.0],
        ] {
            let again = camera.pixel(camera.ray(pixel).unwrap()).unwrap();
            let miss_px = (pixel[0] - again[0]).hypot(pixel[1] - again[1]);
            assert!(miss_px < 1e-6, "{lens:?} {pixel:?}: {again:?}");
        }
    }
}

#[test]
fn what_is_behind_or_beyond_the_lens_is_not_seen() {
    assert_eq!(camera(Lens::Pinhole).pixel([0.0, 0.0, -3.0]), None);
    // r (1 - 0.4 r^2 + ...) turns back near a tangent of 1: beyond, two points would share a pixel.
    let barrel = camera(Lens::PlumbBob([-0.404, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(barrel.pixel([2.0, 0.0, 1.0]), None);
    assert!(barrel.pixel([0.5, 0.0, 1.0]).is_some());
    assert_eq!(barrel.ray([3_000.0, 530.0]), None);
}
