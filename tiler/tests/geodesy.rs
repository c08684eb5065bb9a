//! Frames, UTM, MGRS and geodesics against PROJ and GEOTRANS (tests/oracles/geodesy.py), and their
//! algebra by properties.

use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use serde_json::Value;
use tilefold_tiler::geodesy::{
    LocalFrame, Utm, bearing_from_yaw, ecef_from_wgs84, geodesic_m, utm_from_wgs84,
    wgs84_from_ecef, wgs84_from_utm, wrap_angle, yaw_from_bearing,
};
use tilefold_tiler::mgrs::{mgrs_from_wgs84, square_origin, wgs84_from_mgrs};

fn golden(name: &str) -> Vec<Value> {
    let text = include_str!("../../tests/oracles/geodesy.json");
    let figures: Value = serde_json::from_str(text).expect("a golden figure");
    figures[name].as_array().expect("a golden figure").clone()
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list = value.as_array().expect("a golden figure");
    std::array::from_fn(|i| list[i].as_f64().expect("a golden figure"))
}

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// Metres between two positions, well-defined at the poles too.
fn apart_wgs84(a: [f64; 3], b: [f64; 3]) -> f64 {
    apart(ecef_from_wgs84(a), ecef_from_wgs84(b))
}

#[test]
fn frames_agree_with_proj_within_a_micrometre() {
    let mut worst_m = 0.0_f64;
    let mut seen = 0;
    for frame in golden("frames") {
        let anchor = numbers(&frame["anchor"]);
        let local = LocalFrame::new(anchor);
        worst_m = worst_m.max(apart(ecef_from_wgs84(anchor), numbers(&frame["ecef"])));
        for point in frame["points"].as_array().unwrap() {
            let wgs84 = numbers(&point["wgs84"]);
            let enu = numbers(&point["enu"]);
            worst_m = worst_m.max(apart(local.to_enu(wgs84), enu));
            worst_m = worst_m.max(apart_wgs84(local.to_wgs84(enu), wgs84));
            seen += 1;
        }
    }
    println!("{seen} points up to 100 km away: at most {worst_m:.1e} m apart");
    assert!(seen >= 200);
    assert!(worst_m < 1e-6, "{worst_m}");
}

#[test]
fn yaws_turn_by_the_meridian_convergence_that_proj_sees() {
    let mut turned = 0.0_f64;
    for row in golden("convergence") {
        let frame = LocalFrame::new(numbers(&row["anchor"]));
        let there = LocalFrame::new(numbers(&row["at"]));
        let expected = row["north_yaw_rad"].as_f64().unwrap();
        let north = there.yaw_in(&frame, FRAC_PI_2);
        assert!(wrap_angle(north - expected).abs() < 1e-7, "{row}: {north}");
        turned = turned.max(wrap_angle(north - FRAC_PI_2).abs());
    }
    assert!(
        turned > 0.01,
        "the golden points are too near to show a turn"
    );
}

#[test]
fn utm_agrees_with_proj_within_a_micrometre() {
    for row in golden("utm") {
        let [longitude_deg, latitude_deg] = numbers(&row["at"]);
        let [easting_m, northing_m] = numbers(&row["utm"]);
        let utm = utm_from_wgs84(longitude_deg, latitude_deg).unwrap();
        assert_eq!(u64::from(utm.zone), row["zone"].as_u64().unwrap(), "{row}");
        assert_eq!(utm.north, row["north"].as_bool().unwrap());
        assert!((utm.easting_m - easting_m).abs() < 1e-6, "{row}: {utm:?}");
        assert!((utm.northing_m - northing_m).abs() < 1e-6, "{row}: {utm:?}");
        let [back_lon, back_lat] = wgs84_from_utm(&utm).unwrap();
        let back = [back_lon, back_lat, 0.0];
        assert!(apart_wgs84(back, [longitude_deg, latitude_deg, 0.0]) < 1e-6);
    }
}

#[test]
fn mgrs_agrees_with_geotrans() {
    for row in golden("utm") {
        let [longitude_deg, latitude_deg] = numbers(&row["at"]);
        for (digits, text) in [0, 3, 5].into_iter().zip(row["mgrs"].as_array().unwrap()) {
            let text = text.as_str().unwrap();
            let ours = mgrs_from_wgs84(longitude_deg, latitude_deg, digits).unwrap();
            assert_eq!(ours, text, "{row}");
        }
        let square = row["mgrs"][2].as_str().unwrap();
        let [lon, lat] = wgs84_from_mgrs(square).unwrap();
        let off_m = geodesic_m([lon, lat, 0.0], [longitude_deg, latitude_deg, 0.0]);
        assert!(
            off_m < 0.75,
            "{row}: the middle of a metre's square is {off_m} m away"
        );
    }
}

#[test]
fn geodesics_agree_with_proj() {
    for row in golden("geodesics") {
        let [[a_lon, a_lat], [b_lon, b_lat]] = [numbers(&row["from"]), numbers(&row["to"])];
        let length_m = geodesic_m([a_lon, a_lat, 0.0], [b_lon, b_lat, 0.0]);
        assert!(
            (length_m - row["m"].as_f64().unwrap()).abs() < 1e-6,
            "{row}"
        );
    }
}

#[test]
fn autoware_counts_from_the_corner_of_its_square() {
    let origin = square_origin("54SUE815501").unwrap();
    assert_eq!(
        origin,
        Utm {
            zone: 54,
            north: true,
            easting_m: 300_000.0,
            northing_m: 3_900_000.0
        }
    );
    assert_eq!(square_origin("54SUE").unwrap(), origin);
}

#[test]
fn references_at_their_edges() {
    for (lon, lat, text) in [
        (0.0, 0.0, "31NAA6602100000"),
        (0.0, -1e-15, "31MAV6602199999"),
        (6.0, 84.0, ""),
        (6.0, 83.99, "31XEP3505227890"),
        (3.0, -80.0, "31CEM0000018414"),
        (5.0, 60.0, "32VKM7697958157"),
        (10.0, 75.0, "33XUD5570629692"),
    ] {
        match mgrs_from_wgs84(lon, lat, 5) {
            Ok(ours) => assert_eq!(ours, text),
            Err(error) => assert_eq!(text, "", "{error}"),
        }
    }
}

#[test]
fn bearings_and_yaws() {
    for (bearing_deg, yaw_rad) in [
        (0.0, FRAC_PI_2),
        (90.0, 0.0),
        (180.0, -FRAC_PI_2),
        (270.0, PI),
    ] {
        assert!((yaw_from_bearing(bearing_deg) - yaw_rad).abs() < 1e-12);
        assert!((bearing_from_yaw(yaw_rad) - bearing_deg).abs() < 1e-12);
    }
    assert_eq!(bearing_from_yaw(FRAC_PI_2 + 1e-17), 0.0);
}

#[test]
fn errors_say_what_to_do() {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let swapped = utm_from_wgs84(49.0, 120.0).unwrap_err();
    assert!(said(&swapped).contains("check the order (longitude first)"));
    assert!(utm_from_wgs84(f64::NAN, 0.0).is_err());
    assert!(mgrs_from_wgs84(8.0, 49.0, 9).is_err());
    let no_zone = Utm {
        zone: 61,
        north: true,
        easting_m: 5e5,
        northing_m: 5e6,
    };
    assert!(wgs84_from_utm(&no_zone).is_err());
    assert!(
        wgs84_from_utm(&Utm {
            easting_m: f64::NAN,
            ..no_zone
        })
        .is_err()
    );
    for text in [
        "",
        "54",
        "54S",
        "54SU",
        "54SUE1",
        "61SUE",
        "0SUE",
        "54SAE",
        "54SUW",
        "32XUE",
        "54SUE1x",
        "54SIE",
        "54SUE12é4",
        "999SUE",
    ] {
        let error = wgs84_from_mgrs(text).unwrap_err();
        assert!(said(&error).contains("no MGRS reference"), "{text}");
    }
}

proptest! {
    #[test]
    fn there_and_back(
        lon in -180.0..180.0_f64, lat in -90.0..=90.0_f64, h in -500.0..9_000.0_f64,
        east in -1e5..1e5_f64, north in -1e5..1e5_f64, up in -500.0..9_000.0_f64,
    ) {
        let frame = LocalFrame::new([lon, lat, h]);
        let enu = [east, north, up];
        prop_assert!(apart(frame.to_enu(frame.to_wgs84(enu)), enu) < 1e-7);
        prop_assert!(apart(frame.to_enu([lon, lat, h]), [0.0; 3]) < 1e-8);
        let ecef = ecef_from_wgs84([lon, lat, h]);
        prop_assert!(apart(ecef_from_wgs84(wgs84_from_ecef(ecef)), ecef) < 1e-7);
    }

    #[test]
    fn a_yaw_turns_back(lon in -180.0..180.0_f64, lat in -85.0..85.0_f64, yaw in -PI..PI, step in -0.5..0.5_f64) {
        let here = LocalFrame::new([lon, lat, 0.0]);
        let there = LocalFrame::new([lon + step, lat + step, 0.0]);
        let back = there.yaw_in(&here, here.yaw_in(&there, yaw));
        // Two horizons lean against each other by up to a degree: second order remains.
        prop_assert!(wrap_angle(back - yaw).abs() < 5e-4);
        prop_assert!(wrap_angle(yaw_from_bearing(bearing_from_yaw(yaw)) - yaw).abs() < 1e-12);
    }

    #[test]
    fn utm_there_and_back(lon in -180.0..180.0_f64, lat in -90.0..=90.0_f64) {
        let utm = utm_from_wgs84(lon, lat).unwrap();
        let [back_lon, back_lat] = wgs84_from_utm(&utm).unwrap();
        prop_assert!(apart_wgs84([back_lon, back_lat, 0.0], [lon, lat, 0.0]) < 1e-6);
        prop_assert_eq!(utm.zone == 0, mgrs_from_wgs84(lon, lat, 8).is_err());
        prop_assume!(utm.zone != 0);
        let text = mgrs_from_wgs84(lon, lat, 8).unwrap();
        let [mid_lon, mid_lat] = wgs84_from_mgrs(&text).unwrap();
        prop_assert!(apart_wgs84([mid_lon, mid_lat, 0.0], [lon, lat, 0.0]) < 2e-3, "{}", text);
    }

    #[test]
    fn no_text_makes_mgrs_panic(text in "\\PC{0,20}", near in "[0-9]{0,3}[A-Za-z]{0,4}[0-9]{0,24}") {
        let _ = wgs84_from_mgrs(&text);
        let _ = wgs84_from_mgrs(&near);
        let _ = square_origin(&near);
    }
}
