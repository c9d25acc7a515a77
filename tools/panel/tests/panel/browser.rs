//! The page in a browser.

use crate::hands::{commission, jog, retrain, told};
use crate::served::{NODE, Served};
use crate::webdriver::Browser;
use serde_json::json;

pub fn a_robot_is_drawn_where_its_joints_are_and_each_has_its_own_page() {
    let served = Served::arm(&[NODE, NODE + 1, NODE + 2]);
    let browser = Browser::begin();
    browser.window(1280, 1000, "light");
    let shoulder = format!("{}/#node={}", served.address, NODE + 1);
    browser.open(shoulder);
    browser.until("panel.robot.joints.length === 3 && panel.side.cards.size === 2");
    let all = "panel.robot.joints.every(({ node }) => Number.isFinite(panel.robot.position(node)))";
    browser.until(all);
    // It hangs: the forearm's centre is 0.5 m below the shoulder, which is 1 m high.
    let tip = "panel.robot.lines().at(-1)[1]";
    browser.until(&format!("Math.hypot({tip}[0] - 0.01, {tip}[1] - 0.02, {tip}[2] - 0.5) < 0.01"));
    jog(&browser, "0.4", &format!("Math.abs({tip}[0]) > 0.1"));
    browser.mouse("#jog-forward", "pointerUp");
    browser.until("document.querySelector('#state').textContent.startsWith('disabled')");
    browser.show("#robot");
    browser.picture("panel-robot.png");
    // What is held is not moved by gravity, and the picture stays.
    browser.until(&format!("panel.robot.frames > 10 && Math.abs({tip}[0]) > 0.1"));
    browser.value("void document.querySelector('#robot a').click()");
    browser.until("document.title === 'Joint 5' && panel.robot.joints.length === 3");
    browser.window(390, 1000, "dark");
    browser.until("document.documentElement.scrollWidth <= window.innerWidth");
    browser.show("#robot");
    browser.picture("panel-robot-390-dark.png");
    assert_eq!(browser.value("panel.problems"), json!([]));
}

pub fn the_page_shows_values_that_move_and_the_joint_stands_once_the_button_is_let_go() {
    let served = Served::joints(&[NODE, 9]);
    let browser = Browser::begin();
    browser.window(1280, 1000, "light");
    browser.open(served.address);
    // The page shows what the joint sends.
    browser.until("document.querySelector('#state').textContent.startsWith('disabled')");
    browser.until("Number.isFinite(panel.latest('velocity-actual-value'))");
    let strokes = "panel.plots.count()";
    let before = browser.value(strokes).as_u64().unwrap();
    browser.until(&format!("{strokes} > {}", before + 20));
    jog(&browser, "0.8", "panel.latest('velocity-actual-value') > 0.6");
    browser.picture("panel-moving.png");
    browser.mouse("#jog-forward", "pointerUp");
    browser.until("document.querySelector('#state').textContent.startsWith('disabled')");
    browser.until("Math.abs(panel.latest('velocity-actual-value')) < 0.05");
    // The space bar is STOP, whatever has the focus; a hidden page holds nothing.
    browser.mouse("#jog-back", "pointerDown");
    browser.until("panel.isHeld()");
    browser.value("void window.dispatchEvent(new Event('blur'))");
    browser.until("!panel.isHeld()");
    browser.mouse("#jog-back", "pointerUp");
    browser.value("void document.dispatchEvent(new KeyboardEvent('keydown', { code: 'Space', cancelable: true }))");
    browser.until("document.querySelector('#log').textContent.includes('STOP')");
    for (button, shown) in [
        ("#load-checklist", "#checklist tr:nth-child(5)"),
        ("#load-scan", "#joints tr:nth-child(1)"),
        ("#load-objects", "#objects tr:nth-child(40)"),
        ("#load-images", "#images tr:nth-child(3)"),
    ] {
        browser.click(button);
        browser.until(&format!("document.querySelector('{shown}') !== null"));
    }
    // The other joint stands beside this one, and no longer.
    browser.value("void document.querySelector('#joints button').click()");
    browser.until("Number.isFinite(panel.side.cards.get(9).plots.latest('velocity-actual-value'))");
    browser.picture("panel-beside.png");
    browser.value("void document.querySelector('#joints button').click()");
    browser.until("document.querySelector('#side').childElementCount === 0");
    // A new board's settings are filled in, and none of them is set.
    browser.value("void (document.querySelector('#new-board').value = 'moteus-r4')");
    browser.value("void document.querySelector('#new-board').dispatchEvent(new Event('change'))");
    browser.until("document.querySelectorAll('#objects tr.changed').length > 5");
    browser.value("void document.querySelector('#load-objects').click()");
    browser.until("document.querySelectorAll('#objects tr.changed').length === 0");
    commission(&browser, &[("current", 8.0), ("travel", 0.4)], false, 7);
    browser.click("#load-objects");
    browser.until(&told("stored", "What is in use: as stored 20"));
    retrain(&browser, 1);
    for (width, height, scheme) in
        [(1280, 3200, "light"), (1280, 3200, "dark"), (390, 3200, "light"), (390, 3200, "dark")]
    {
        browser.window(width, height, scheme);
        browser.value("void window.scrollTo(0, 0)");
        let drawn = browser.value("panel.plots.drawn()").as_u64().unwrap();
        browser.until(&format!("panel.plots.drawn() > {}", drawn + 2));
        browser.picture(&format!("panel-{width}-{scheme}.png"));
        // No element hangs over the side.
        browser.until("document.documentElement.scrollWidth <= window.innerWidth");
    }
    assert_eq!(browser.value("panel.problems"), json!([]));
}
