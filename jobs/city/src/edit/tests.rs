use super::*;
use crate::network;

const DAY: i64 = 86_400_000_000_000;

fn campaign(during: f64) -> Campaign {
    Campaign {
        begin_ns: 1_000 * DAY,
        days: 20.0,
        during,
    }
}

fn changed(seed: u64, share: f64, during: f64) -> (World, World, History) {
    let before = network::draw(seed, 12.0, [10.0, 50.0, 300.0]);
    let mut after = before.clone();
    let history = draw(&mut after, seed, share, campaign(during));
    (before, after, history)
}

#[test]
fn nothing_happens_to_a_control() {
    let (before, after, history) = changed(1, 0.0, 0.0);
    assert_eq!(before.paint, after.paint);
    assert_eq!(before.paint, history.map);
    assert!(history.changes.is_empty());
}

#[test]
fn everything_happens_about_as_often_as_it_should() {
    let (before, _, history) = changed(2, 0.05, 0.0);
    let wanted = 0.05 * before.paint.len() as f64;
    for (happening, share) in SHARES {
        let count = history
            .changes
            .iter()
            .filter(|change| change.happening == happening);
        // Lanes change two lines at once.
        let count = count.count() as f64;
        assert!(
            count >= (0.4 * share * wanted).floor(),
            "{happening:?}: {count}"
        );
        assert!(
            count <= 2.0 * share * wanted + 2.0,
            "{happening:?}: {count}"
        );
    }
}

#[test]
fn what_is_rounded_off_is_made_up_for() {
    let mut often: BTreeMap<Happening, u32> = BTreeMap::new();
    for seed in 0..2_000 {
        let happenings = happenings(7.0, &mut Random::new(seed, "test", 0));
        assert_eq!(happenings.len(), 7);
        for happening in happenings {
            *often.entry(happening).or_default() += 1;
        }
    }
    for (happening, share) in SHARES {
        let found = f64::from(often[&happening]) / 14_000.0;
        assert!((found - share).abs() < 0.01, "{happening:?}: {found}");
    }
}

#[test]
fn nothing_happens_where_nobody_drives() {
    let mut world = network::draw(6, 2.0, [10.0, 50.0, 300.0]);
    // All lanes end at the line between east and west.
    for lane in &mut world.lanes {
        lane.centre
            .iter_mut()
            .for_each(|point| point[0] = point[0].max(0.0));
    }
    let history = draw(&mut world, 6, 0.1, campaign(0.0));
    assert!(history.changes.len() > 5);
    for change in &history.changes {
        let middle = change.paint.points[change.paint.points.len() / 2];
        assert!(middle[0] > -SEEN_M - 2.0, "{change:?}");
    }
}

/// The map and the road at the end differ just where the changes say.
#[test]
fn the_changes_are_the_difference() {
    let (_, after, history) = changed(3, 0.06, 0.3);
    let end_ns = campaign(0.3).end_ns();
    let mut told: BTreeMap<i64, ChangeType> = BTreeMap::new();
    for change in &history.changes {
        if (change.since_ns..change.until_ns).contains(&end_ns) {
            told.insert(change.paint.id, change.change_type);
        }
    }
    let map: BTreeMap<i64, &Paint> = history.map.iter().map(|paint| (paint.id, paint)).collect();
    let mut road: BTreeMap<i64, Vec<&Paint>> = BTreeMap::new();
    for paint in after.paint.iter().filter(|paint| paint.is_there(end_ns)) {
        road.entry(paint.id).or_default().push(paint);
    }
    for (id, mapped) in &map {
        let is_same = road.get(id).is_some_and(|there| {
            there.len() == 1
                && there[0].points == mapped.points
                && there[0].marking == mapped.marking
                && there[0].sign == mapped.sign
        });
        let said_changed = told
            .get(id)
            .is_some_and(|told| *told != ChangeType::NoChange);
        assert_eq!(is_same, !said_changed, "{id}: {:?}", told.get(id));
    }
    for id in road.keys().filter(|id| !map.contains_key(id)) {
        assert_eq!(told.get(id), Some(&ChangeType::Added), "{id}");
    }
}

#[test]
fn a_construction_site_comes_and_goes() {
    let (before, after, history) = changed(4, 0.06, 0.0);
    let sites = history
        .changes
        .iter()
        .filter(|change| change.happening == Happening::Construction);
    let mut count = 0;
    for site in sites {
        count += 1;
        assert!(site.since_ns > campaign(0.0).begin_ns && site.until_ns < campaign(0.0).end_ns());
        let at = |time_ns: i64| {
            let there = |paint: &&Paint| paint.id == site.paint.id && paint.is_there(time_ns);
            let there: Vec<&Paint> = after.paint.iter().filter(there).collect();
            assert_eq!(there.len(), 1);
            there[0].points.clone()
        };
        let as_mapped = before
            .paint
            .iter()
            .find(|paint| paint.id == site.paint.id)
            .map(|p| &p.points);
        assert_eq!(Some(&at(site.since_ns - 1)), as_mapped);
        assert_eq!(at(site.since_ns), site.paint.points);
        assert_eq!(at(site.until_ns - 1), site.paint.points);
        assert_eq!(Some(&at(site.until_ns)), as_mapped);
    }
    assert!(count > 1, "{count}");
}

#[test]
fn a_shift_is_as_long_as_it_says() {
    let (before, _, history) = changed(5, 0.06, 0.0);
    for change in &history.changes {
        let Some(shift_m) = change.shift_m else {
            continue;
        };
        let old = before
            .paint
            .iter()
            .find(|paint| paint.id == change.paint.id);
        let old = old.map_or(&[][..], |paint| &paint.points);
        for (old, new) in old.iter().zip(&change.paint.points) {
            let moved_m = (new[0] - old[0]).hypot(new[1] - old[1]);
            assert!(
                (moved_m - shift_m.abs()).abs() < 1e-6,
                "{moved_m} {shift_m}"
            );
        }
    }
}
