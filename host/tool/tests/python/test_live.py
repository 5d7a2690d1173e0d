"""The page of `palpate live` in a browser, with the emulated board."""

import csv
import http.client
import json
import os
import shutil
import signal
import socket
import time
from urllib.parse import urlsplit

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

from made_board import MadeBoard

# The emulation may run slower than real time.
PATIENCE_S = 60


class Live:
    """`palpate live`, which can be ended and started again at the same port."""

    def __init__(self, palpate, emulated):
        self.palpate, self.emulated = palpate, emulated
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.start()

    def start(self):
        arguments = ["live", "--json", "--port", str(self.port), "--load", "1.5", *self.emulated]
        self.process = self.palpate.start(*arguments)
        self.url = json.loads(self.process.stdout.readline())["url"]

    def end(self):
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(PATIENCE_S) == 0

    def status(self, path=None, **headers) -> int:
        """Status of the answer to a request, by default of the page with its token."""
        address = urlsplit(self.url)
        connection = http.client.HTTPConnection("127.0.0.1", self.port)
        connection.request("GET", path or address.path, headers=headers)
        return connection.getresponse().status


@pytest.fixture(scope="module")
def live(palpate, emulated, tmp_path_factory):
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))
    board = [*emulated[:-1], "live.flash"]
    served = Live(palpate, board)
    yield served
    served.end()


@pytest.fixture(scope="module")
def browser():
    """Chromium without a window. Its driver is Debian's, so that none is fetched."""
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    assert chromium and driver, "install a browser: apt-get install chromium chromium-driver"
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage"]:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    service = webdriver.ChromeService(executable_path=driver)
    opened = webdriver.Chrome(options=options, service=service)
    yield opened
    opened.quit()


@pytest.fixture
def page(live, browser):
    """The page, connected, with the log of what the browser has done since it was opened."""
    browser.get_log("performance")
    browser.get_log("browser")
    browser.get(live.url)
    until(browser, "connection", "Connected")
    return browser


def text(browser, name: str) -> str:
    return browser.find_element(By.ID, name).text


def until(browser, name: str, expected: str, patience_s: float = PATIENCE_S):
    """Waits for a text in an element."""
    wait = WebDriverWait(browser, patience_s)
    wait.until(lambda _: expected in text(browser, name), f"{name} never says {expected!r}")


def until_other(browser, read):
    """Waits until something that is read has changed."""
    before = read()
    WebDriverWait(browser, PATIENCE_S).until(lambda _: read() != before)


def drawn(browser, plot: str) -> str:
    script = "return document.querySelector(`#${arguments[0]} canvas`).toDataURL()"
    return browser.execute_script(script, plot)


def shown(browser) -> str:
    """The part of the dialogue that shows."""
    script = "return document.querySelector('dialog [data-phase]:not([hidden])').dataset.phase"
    return browser.execute_script(script)


def focused(browser) -> str:
    script = "const of = document.activeElement; return of.id || of.dataset.action || of.tagName"
    return browser.execute_script(script)


def press(browser, *keys: str):
    for key in keys:
        webdriver.ActionChains(browser).send_keys(key).perform()


def test_the_readings_change_and_the_plots_move(page):
    until(page, "readings", "MHz")
    until_other(page, lambda: text(page, "readings"))
    for plot in ["frequency-plot", "current-plot"]:
        until_other(page, lambda: drawn(page, plot))
    assert "0 of " in text(page, "losses")


def test_no_request_leaves_this_computer(page, live):
    until(page, "readings", "MHz")
    events = [json.loads(entry["message"])["message"] for entry in page.get_log("performance")]
    asked = [event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"]
    sockets = [event["params"]["url"] for event in events if event["method"] == "Network.webSocketCreated"]
    own = urlsplit(live.url).netloc
    assert len(asked) >= 10 and len(sockets) >= 1
    assert {urlsplit(url).netloc for url in asked + sockets} == {own}, asked
    assert page.get_log("browser") == []
    # The policy, and not the page's good will alone, keeps it from any other.
    script = "fetch('http://localhost:9/').catch(() => 0).then(arguments[0])"
    page.execute_async_script(script)
    refusals = [entry["message"] for entry in page.get_log("browser")]
    assert any("Content Security Policy" in message and "default-src 'self'" in message for message in refusals)


def test_a_request_without_the_token_or_from_elsewhere_is_refused(live):
    path = urlsplit(live.url).path
    upgrade = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }
    assert live.status() == 200
    assert live.status(f"{path}socket", **upgrade) == 101
    for other in ["/", "/socket", "/page.js", "/" + "0" * 32 + "/", f"{path[:-2]}/"]:
        assert live.status(other, **upgrade) == 403, other
    # A name that an attacker's server has pointed to this computer, and a page of another origin.
    assert live.status(Host="attacker.example") == 403
    # A port that is forwarded here.
    assert live.status(Host="localhost:9000") == 200
    assert live.status(f"{path}socket", **upgrade, Host=f"attacker.example:{live.port}") == 403
    assert live.status(f"{path}socket", **upgrade, Origin="http://attacker.example") == 403
    assert live.status(f"{path}socket", **upgrade, Origin=f"http://127.0.0.1:{live.port}") == 101
    with socket.socket() as other:
        # It listens on loopback alone.
        assert other.connect_ex((socket.gethostbyname(socket.gethostname()), live.port)) != 0 or (
            socket.gethostbyname(socket.gethostname()).startswith("127.")
        )


def test_everything_is_reached_by_keys_alone(page):
    page.find_element(By.TAG_NAME, "body").click()
    order = []
    for _ in range(4):
        press(page, Keys.TAB)
        order.append(focused(page))
        outline = "return getComputedStyle(document.activeElement).outlineWidth"
        assert page.execute_script(outline) == "3px", order
    assert order == ["arm", "stop", "calibrate", "restart"]
    names = [button.accessible_name for button in page.find_elements(By.CSS_SELECTOR, "main button")]
    assert names == ["Arm", "Stop", "Calibrate…", "Restart board", "Save as CSV"]
    webdriver.ActionChains(page).key_down(Keys.SHIFT).send_keys(Keys.TAB).key_up(Keys.SHIFT).perform()
    assert focused(page) == "calibrate"
    press(page, Keys.ENTER)
    dialog = page.find_element(By.ID, "calibration")
    assert (dialog.is_displayed(), dialog.aria_role, dialog.accessible_name) == (True, "dialog", "Calibrate the sensor")
    assert (shown(page), focused(page)) == ("ready", "start")
    press(page, Keys.ESCAPE)
    assert not dialog.is_displayed() and focused(page) == "calibrate"
    # Space works as Enter does. Without its coil's data in force the board does not arm.
    page.execute_script("document.getElementById('arm').focus()")
    press(page, Keys.SPACE)
    WebDriverWait(page, PATIENCE_S).until(lambda _: text(page, "answer") != "")


@pytest.mark.parametrize("width", [800, 1600])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_overlaps(page, width, scheme):
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    until(page, "readings", "MHz")
    script = """
        const inside = (a, b) => a.x >= b.x - 1 && a.right <= b.right + 1 && a.y >= b.y - 1 && a.bottom <= b.bottom + 1;
        const apart = (a, b) => a.right <= b.x || b.right <= a.x || a.bottom <= b.y || b.bottom <= a.y;
        const all = [...document.querySelectorAll("header, section, figure, .plot, button, canvas, dd, p, h2")]
          .map((of) => [of, of.getBoundingClientRect()]).filter(([, box]) => box.width && box.height);
        const wrong = [];
        for (const [one, a] of all) for (const [other, b] of all) {
          const fits = one.contains(other) ? inside(b, a) : other.contains(one) || apart(a, b);
          if (!fits) wrong.push([one.id || one.outerHTML.slice(0, 60), other.id || other.outerHTML.slice(0, 60)]);
        }
        return [document.documentElement.scrollWidth, wrong];
    """
    # The plots follow the window some frames later.
    deadline = time.monotonic() + PATIENCE_S
    wide, wrong = page.execute_script(script)
    while (wide > width or wrong) and time.monotonic() < deadline:
        time.sleep(0.1)
        wide, wrong = page.execute_script(script)
    page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert wide <= width and wrong == []


def test_a_calibration_that_is_aborted_leaves_the_one_before_in_force(page):
    page.find_element(By.ID, "calibrate").click()
    assert shown(page) == "ready"
    press(page, Keys.ENTER)
    until(page, "calibration", "Run 2 of")
    assert text(page, "connection").endswith("Calibration under way")
    disabled = [button.get_attribute("aria-disabled") for button in page.find_elements(By.CSS_SELECTOR, "main button")]
    assert disabled[:4] == ["true", "false", None, "true"]
    until_other(page, lambda: drawn(page, "frequency-plot"))
    page.find_element(By.CSS_SELECTOR, "[data-action=abort]").click()
    until(page, "calibration", "it was aborted. The previous one is active.")
    assert focused(page) == "dismiss"
    press(page, Keys.ENTER)
    until(page, "connection", "Connected")
    until_other(page, lambda: text(page, "readings"))


def test_a_fault_says_what_to_check(palpate, live, browser):
    board = MadeBoard(0)
    served = palpate.start("live", "--json", "--port", "0", "--board", board.address)
    browser.get(json.loads(served.stdout.readline())["url"])
    until(browser, "faults", "None.")
    board.begin_fault(12, 1.0)
    until(browser, "faults", "12 sensor not oscillating")
    said = text(browser, "faults")
    assert "A sensor does not oscillate. Value: channel. Check coil and capacitor." in said
    assert "value 1" in said
    clear = browser.find_element(By.CSS_SELECTOR, "#faults button")
    assert clear.accessible_name == "Clear fault 12"
    clear.click()
    until(browser, "answer", "clear_fault")
    served.send_signal(signal.SIGINT)
    assert served.wait(PATIENCE_S) == 0


def test_a_refusal_leaves_the_stiffness_and_all_measurements_are_saved(palpate, browser, tmp_path):
    board = MadeBoard(0)
    served = palpate.start("live", "--json", "--port", "0", "--board", board.address)
    browser.get(json.loads(served.stdout.readline())["url"])
    until(browser, "no-measurements", "None since palpate live was started.")
    board.send("refusal")
    until(browser, "interval", "No stiffness yet.")
    board.send("estimate")
    until(browser, "stiffness", "6.01 N/mm")
    assert text(browser, "refusal") == ""
    board.send("refusal")
    until(browser, "refusal", "Measurement 2 refused: ")
    assert text(browser, "stiffness") == "6.01 N/mm" and "between 5.85 and 6.18" in text(browser, "interval")
    assert "Measurement 1, at " in text(browser, "result-details") and "; refused " in text(browser, "result-details")
    until_other(browser, lambda: text(browser, "result-details"))
    rows = [row.text for row in browser.find_elements(By.CSS_SELECTOR, "#measurements tr")]
    assert len(rows) == 3 and "6.01 N/mm 5.85 to 6.18" in rows[1] and "Refused" in rows[0] and "Refused" in rows[2], rows
    behavior = {"behavior": "allow", "downloadPath": str(tmp_path)}
    browser.execute_cdp_cmd("Browser.setDownloadBehavior", behavior)
    browser.find_element(By.ID, "save").click()
    saved = tmp_path / "palpate-measurements.csv"
    WebDriverWait(browser, PATIENCE_S).until(lambda _: saved.exists(), "nothing is saved")
    lines = list(csv.DictReader(saved.read_text().splitlines()))
    assert [line["measurement"] for line in lines] == ["2", "1", "2"]
    assert [line["stiffness_n_per_m"] for line in lines] == ["", "6010", ""]
    assert [bool(line["refusal"]) for line in lines] == [True, False, True]
    # A page that is opened later has them too.
    browser.refresh()
    until(browser, "stiffness", "6.01 N/mm")
    served.send_signal(signal.SIGINT)
    assert served.wait(PATIENCE_S) == 0


def test_it_goes_on_after_the_board_has_started_anew(page):
    count = lambda: int(text(page, "losses").split(" of ")[1].split()[0])
    WebDriverWait(page, PATIENCE_S).until(lambda _: count() > 2000)
    page.find_element(By.ID, "restart").click()
    WebDriverWait(page, PATIENCE_S).until(lambda _: count() < 1000, "the board does not start anew")
    until_other(page, lambda: text(page, "readings"))
    until_other(page, lambda: drawn(page, "frequency-plot"))


def test_it_goes_on_after_the_tool_was_started_again(page, live):
    live.end()
    until(page, "connection", "Start it again")
    live.start()
    until(page, "connection", "Connected")
    until_other(page, lambda: text(page, "readings"))
    until_other(page, lambda: drawn(page, "frequency-plot"))


@pytest.mark.slow
def test_a_calibration_is_kept_and_a_press_is_measured(page):
    page.find_element(By.ID, "calibrate").click()
    press(page, Keys.ENTER)
    until(page, "calibration", "It is not active yet.", 1800)
    press(page, Keys.ENTER)
    until(page, "calibration", "is active and stored.")
    press(page, Keys.ENTER)
    until(page, "connection", "Connected")
    until(page, "readings", " µm\nFrequency")
    page.find_element(By.ID, "arm").click()
    until(page, "state", "Armed.")
    until(page, "interval", "between", 300)
    assert text(page, "stiffness").endswith(" N/mm")
    until(page, "line-text", "by the board")
