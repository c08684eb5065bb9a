//! A sensor model as rows of the store's table, and back.

use std::collections::BTreeMap;

use tilefold_schemas::SensorRow;
use tilefold_schemas::id::hash_text;

use crate::sensor::{ByVisibility, SensorModel, VehicleModel};
use crate::space::LEVELS;

/// Names of the shares of [`crate::space::LEVELS`].
const LEVEL_NAMES: [&str; LEVELS.len()] = ["seen_well", "seen_less", "hidden_from_aside"];

impl SensorModel {
    /// Id of the model: a hash of all its parameters; 0 is the built-in one.
    #[must_use]
    pub fn id(&self) -> i64 {
        match *self == Self::default() {
            true => 0,
            false => hash_text(&self.text()),
        }
    }

    /// All parameters in one text: floats as their bits, so that equal texts are equal models.
    fn text(&self) -> String {
        let lines = self.parameters().into_iter();
        let line = lines.map(|(vehicle, name, visibility, value)| {
            format!(
                "{vehicle:?} {name} {:x} {:x}\n",
                visibility.to_bits(),
                value.to_bits()
            )
        });
        line.collect()
    }

    /// Every parameter: of which vehicle, its name, at which visibility, its value.
    fn parameters(&self) -> Vec<(Option<i64>, &'static str, f64, f64)> {
        let mut all = Vec::new();
        for (name, values) in [
            ("present", &self.present),
            ("pass_sigma_m", &self.pass_sigma_m),
            ("place_sigma_m", &self.place_sigma_m),
        ] {
            all.extend(values.0.iter().map(|&[at, value]| (None, name, at, value)));
        }
        for (name, value) in [
            ("present_concentration", self.present_concentration),
            ("absent", self.absent),
            ("absent_concentration", self.absent_concentration),
            ("vehicle_sigma_m", self.vehicle_sigma_m),
            ("removed", self.removed),
            ("shifted", self.shifted),
            ("residual_outliers", self.residual_outliers),
            ("marking_read", self.marking_read),
        ] {
            all.push((None, name, 0.0, value));
        }
        for (name, share) in LEVEL_NAMES.iter().zip(self.levels) {
            all.push((None, name, 0.0, share));
        }
        for (&key, vehicle) in &self.vehicles {
            all.push((Some(key), "detection", 0.0, vehicle.detection));
            all.push((Some(key), "absent", 0.0, vehicle.absent));
            all.push((Some(key), "sigma", 0.0, vehicle.sigma));
        }
        all
    }

    /// The model as rows of the store; none for the built-in one.
    #[must_use]
    pub fn to_rows(&self) -> Vec<SensorRow> {
        let model = self.id();
        if model == 0 {
            return Vec::new();
        }
        let row = |(vehicle, parameter, visibility, value): (_, &str, _, _)| SensorRow {
            model,
            vehicle,
            parameter: parameter.to_owned(),
            visibility,
            value,
        };
        self.parameters().into_iter().map(row).collect()
    }

    /// The model that rows of the store say; what they do not say is as built in.
    #[must_use]
    pub fn from_rows(rows: &[SensorRow]) -> Self {
        let mut model = Self::default();
        let curve = |name: &str| -> Option<ByVisibility> {
            let of = rows.iter().filter(|row| row.parameter == name);
            let mut points: Vec<[f64; 2]> = of.map(|row| [row.visibility, row.value]).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            (!points.is_empty()).then_some(ByVisibility(points))
        };
        let number = |name: &str, vehicle: Option<i64>| {
            let of = |row: &&SensorRow| row.parameter == name && row.vehicle == vehicle;
            rows.iter().find(of).map(|row| row.value)
        };
        for (name, values) in [
            ("present", &mut model.present),
            ("pass_sigma_m", &mut model.pass_sigma_m),
            ("place_sigma_m", &mut model.place_sigma_m),
        ] {
            if let Some(curve) = curve(name) {
                *values = curve;
            }
        }
        for (name, value) in [
            ("present_concentration", &mut model.present_concentration),
            ("absent", &mut model.absent),
            ("absent_concentration", &mut model.absent_concentration),
            ("vehicle_sigma_m", &mut model.vehicle_sigma_m),
            ("removed", &mut model.removed),
            ("shifted", &mut model.shifted),
            ("residual_outliers", &mut model.residual_outliers),
            ("marking_read", &mut model.marking_read),
        ] {
            if let Some(number) = number(name, None) {
                *value = number;
            }
        }
        for (name, share) in LEVEL_NAMES.iter().zip(&mut model.levels) {
            if let Some(number) = number(name, None) {
                *share = number;
            }
        }
        let mut vehicles: BTreeMap<i64, VehicleModel> = BTreeMap::new();
        for row in rows {
            let Some(key) = row.vehicle else { continue };
            let vehicle = vehicles.entry(key).or_insert_with(|| model.vehicle(key));
            match row.parameter.as_str() {
                "detection" => vehicle.detection = row.value,
                "absent" => vehicle.absent = row.value,
                "sigma" => vehicle.sigma = row.value,
                _ => {}
            }
        }
        model.vehicles = vehicles;
        model
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_comes_back_from_its_rows() {
        let mut model = SensorModel::default();
        assert!(model.to_rows().is_empty() && SensorModel::from_rows(&[]) == model);
        model.absent = 0.07;
        model.present.0[1] = [0.3, 0.4];
        let lame = VehicleModel {
            detection: 0.5,
            absent: 0.2,
            sigma: 3.0,
        };
        model.vehicles.insert(-5, lame);
        let mut rows = model.to_rows();
        rows.reverse();
        assert_eq!(SensorModel::from_rows(&rows), model);
        assert!(rows.iter().all(|row| row.model == model.id()));
        assert_ne!(model.id(), SensorModel::default().id());
    }
}
