//! Hands at the page: its fields, buttons and sequences.

use crate::served::PATIENCE;
use crate::webdriver::Browser;
use serde_json::json;
use std::time::Instant;

/// Sets a field of the page.
pub fn set(browser: &Browser, id: &str, what: &str) {
    browser.value(&format!("void (document.querySelector('#{id}').{what})"));
}

/// Leads a sequence by its buttons until an expression is true; on a machine that is late for it, again.
pub fn lead(browser: &Browser, part: &str, acknowledge: &str, done: &str) {
    let asks = format!("!document.querySelector('#{part}-question').hidden");
    let began = Instant::now();
    while browser.value(done) != json!(true) {
        let alert = || browser.value("document.querySelector('#alert').textContent");
        assert!(began.elapsed() < 3 * PATIENCE, "{}", alert());
        browser.click(&format!("#{part}"));
        loop {
            browser.until(&format!("{asks} || !panel.isLed()"));
            if browser.value("panel.isLed()") != json!(true) {
                break;
            }
            browser.picture(&format!("panel-{part}.png"));
            browser.click(&format!("#{part}-yes"));
        }
        set(browser, acknowledge, "checked = true");
    }
}

/// Commissions the joint by the page's buttons, with these fields of its plan.
pub fn commission(browser: &Browser, plan: &[(&str, f64)], turn: bool, pole_pairs: usize) {
    for (name, value) in plan {
        set(browser, &format!("plan-{name}"), &format!("value = '{value}'"));
    }
    set(browser, "plan-turn", &format!("checked = {turn}"));
    let taken = "document.querySelector('#taken tr:nth-child(8)') !== null";
    lead(browser, "commission", "plan-acknowledge", taken);
    assert_eq!(browser.value("document.querySelectorAll('#reports button').length"), json!(3));
    browser.until(&told("commission-log", &format!("{pole_pairs} pole pairs")));
}

/// Expression that is true once an element says something.
pub fn told(id: &str, words: &str) -> String {
    format!("document.querySelector('#{id}').textContent.includes('{words}')")
}

/// Lets it learn by the page's buttons; its image gets this version.
pub fn retrain(browser: &Browser, version: u32) {
    for (name, value) in [("excitation", 4.0), ("validation", 2.5), ("restarts", 0.0)] {
        set(browser, &format!("retrain-{name}"), &format!("value = '{value}'"));
    }
    lead(browser, "retrain", "retrain-acknowledge", "document.querySelector('#judged tr:nth-child(3)') !== null");
    assert_eq!(browser.value("document.querySelectorAll('#learned button').length"), json!(7));
    browser.until(&told("images", &format!("version {version}, ")));
    // The report stands in a frame of the page, with its own styles.
    browser.value(
        "void [...document.querySelectorAll('#learned button')].find((b) => b.textContent.startsWith('Show')).click()",
    );
    browser.inside("#learned-frame", || {
        browser.until("document.querySelector('svg') !== null && document.styleSheets.length > 0");
    });
    browser.picture("panel-report.png");
}

/// Holds a button until an expression is true. A busy machine may miss held-messages: then it is pressed again.
pub fn hold(browser: &Browser, button: &str, moved: &str) {
    browser.show(button);
    let began = Instant::now();
    loop {
        browser.mouse(button, "pointerDown");
        browser.until(&format!("{moved} || !panel.isHeld()"));
        if browser.value(moved) == json!(true) {
            return;
        }
        browser.mouse(button, "pointerUp");
        let alert = || browser.value("document.querySelector('#alert').textContent");
        assert!(began.elapsed() < PATIENCE, "{button}: the joint does not move: {}", alert());
    }
}

/// Holds the button of a jog until an expression is true.
pub fn jog(browser: &Browser, velocity: &str, moved: &str) {
    set(browser, "jog-velocity", &format!("value = '{velocity}'"));
    hold(browser, "#jog-forward", moved);
}
