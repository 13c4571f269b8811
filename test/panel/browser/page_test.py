"""The page in a real browser, against a node on the simulated rig."""

import os
import signal
import unittest

from machine import Machine, Network, Page, browser, wait_until
from selenium.webdriver.common.keys import Keys
from stepdriver.srv import MoveTo, SetOutput, SetOutputValue, SpeedOverride

JOG_TIMEOUT = 1.5  # [s] of the machine: longer than a busy browser takes between two messages
PRESSES = 5  # a jog may end by itself on a busy computer
SLOWING = 0.1  # [s] from the highest speed to rest
LATE = 1.0  # [s] that a busy computer may take for a message


def setUpModule():
    global machine, network, chrome
    machine = Machine()
    unittest.addModuleCleanup(machine.end)
    network = Network(machine.port)
    unittest.addModuleCleanup(network.end)
    chrome = browser()
    unittest.addModuleCleanup(chrome.quit)


def position(axis="x"):
    """[mm]"""
    return machine.state(axis)["position"] * 1000.0


def close_other_tabs(kept):
    for tab in chrome.window_handles:
        if tab != kept:
            chrome.switch_to.window(tab)
            chrome.close()
    chrome.switch_to.window(kept)


class OnTheMachine(unittest.TestCase):
    def setUp(self):
        network.mend()
        machine.calm()
        self.page = Page(chrome).open_live(machine.link)
        self.page.take_control()

    def moves(self):
        wait_until(lambda: machine.state("x")["moving"], "x moves")

    def rests(self):
        wait_until(lambda: not machine.state("x")["moving"], "x rests")

    def begin_long_move(self):
        """For longer than a busy browser takes for a stop."""
        self.far = 180 if position() < 100 else 5
        self.page.find(self.page.axis("x", ".goto input")).send_keys(str(self.far))
        machine.call("speed_override", SpeedOverride, factor=0.05)
        self.page.click(self.page.axis("x", ".goto button"))
        self.moves()


class Controls(OnTheMachine):
    def test_enabling_and_disabling(self):
        self.page.click(self.page.axis("x", '[data-do="disable"]'))
        wait_until(lambda: not machine.state("x")["enabled"], "x is disabled")
        wait_until(lambda: self.page.find(self.page.axis("x", '[data-field="motor"]')).text == "off", "off is shown")
        self.assertTrue(machine.state("y")["enabled"])
        self.page.click(self.page.axis("x", '[data-do="enable"]'))
        wait_until(lambda: machine.state("x")["enabled"], "x is enabled")
        self.page.click("#disable-all")
        wait_until(lambda: not machine.state("x")["enabled"] and not machine.state("y")["enabled"], "all disabled")
        self.page.click("#enable-all")
        wait_until(lambda: machine.state("x")["enabled"] and machine.state("y")["enabled"], "all enabled")

    def test_steps_and_positions(self):
        begin = position()
        self.page.click(self.page.axis("x", '[data-by="1"]'))
        wait_until(lambda: abs(position() - begin - 1.0) < 0.02, "one step of 1 mm")
        self.page.click(self.page.axis("x", '[data-by="-0.1"]'))
        wait_until(lambda: abs(position() - begin - 0.9) < 0.02, "one step of -0.1 mm")
        self.page.find(self.page.axis("x", ".goto input")).send_keys("12.5", Keys.ENTER)
        wait_until(lambda: abs(position() - 12.5) < 0.02, "at 12.5 mm")
        shown = '[data-field="position"]'
        wait_until(lambda: abs(float(self.page.find(self.page.axis("x", shown)).text) - 12.5) < 0.02,
                   "the page shows the position")

    def test_a_refusal_is_shown_in_the_words_and_units_of_the_page(self):
        self.page.find(self.page.axis("x", ".goto input")).send_keys("300", Keys.ENTER)
        self.page.wait_said("x: the position 300.0000 mm is above the soft limit max_position 200.0000 mm")
        wait_until(lambda: "300.0000 mm" in self.page.find("#events").text, "the refusal is listed")
        self.assertFalse(machine.state("x")["moving"])

    def test_homing(self):
        self.page.click(self.page.axis("x", '[data-do="home"]'))
        wait_until(lambda: machine.state("x")["homed"], "x is homed")
        wait_until(lambda: "homed" in self.page.find(self.page.axis("x", ".badge")).text, "homed is shown")
        self.assertIn("valid", self.page.find(self.page.axis("x", '[data-field="validity"]')).text)
        self.assertFalse(self.page.find(self.page.axis("y", '[data-do="home"]')).is_displayed())

    def test_an_endstop_that_ended_a_motion_is_shown(self):
        from std_srvs.srv import SetBool
        machine.call("x/move_to", MoveTo, position=0.05, wait=True)
        self.page.find(self.page.axis("x", ".goto input")).send_keys("1", Keys.ENTER)
        self.moves()
        machine.call("rig/x/press_min", SetBool, data=True)
        self.addCleanup(machine.call, "rig/x/press_min", SetBool, data=False)
        self.rests()
        wait_until(lambda: "endstop" in self.page.find(self.page.axis("x", '[data-field="stopped"]')).text,
                   "the page says which")
        wait_until(lambda: self.page.find(self.page.axis("x", '[data-field="min"]')).text == "PRESSED", "and that it is")

    def line(self, name):
        """The text beside an output or input, without its switch."""
        return self.page.find(f'#io [data-name="{name}"] .io-state').text

    def test_outputs_are_switched_and_show_what_the_driver_says(self):
        switch = '#outputs [data-name="pen"] button'
        wait_until(lambda: self.line("pen").startswith("off"), "the pen is off")
        self.assertEqual(self.page.find(switch).get_attribute("aria-checked"), "false")
        self.page.click(switch)
        wait_until(lambda: machine.is_on("pen"), "the driver has switched it on")
        wait_until(lambda: self.page.find(switch).get_attribute("aria-checked") == "true", "the switch is on")
        wait_until(lambda: self.line("pen").startswith("on for "), "and so is its text")
        self.assertFalse(machine.is_on("lamp"))
        self.assertIn("off", self.line("lamp"))
        # Another client, and what the driver does by itself, are shown too.
        machine.call("set_output", SetOutput, name="pen", on=False)
        wait_until(lambda: self.page.find(switch).get_attribute("aria-checked") == "false", "the switch is off")
        self.page.click(switch)
        wait_until(lambda: self.line("pen").startswith("on for "), "the pen is on again")
        self.page.click("#emergency")
        wait_until(lambda: self.line("pen").startswith("off for "), "the pen is safe")
        self.page.click(switch)
        wait_until(lambda: "set output" in self.page.find("#events").text, "the refusal is listed")
        self.assertFalse(machine.is_on("pen"))

    def test_a_pwm_output_shows_its_value(self):
        wait_until(lambda: self.line("laser").startswith("off "), "the laser is off")
        machine.call("set_output_value", SetOutputValue, name="laser", value=0.4)
        wait_until(lambda: self.line("laser").startswith("on at 0.4 for "), "it is on in part")
        self.page.click('#outputs [data-name="laser"] button')
        wait_until(lambda: self.line("laser").startswith("off for "), "the switch is that of an output that is on")
        self.page.click('#outputs [data-name="laser"] button')
        wait_until(lambda: self.line("laser").startswith("on for "), "it is on")

    def test_inputs_show_their_state_and_its_age(self):
        from std_srvs.srv import SetBool
        wait_until(lambda: self.line("paper").startswith("inactive"), "the paper's input is inactive")
        machine.call("rig/inputs/paper", SetBool, data=True)
        self.addCleanup(machine.call, "rig/inputs/paper", SetBool, data=False)
        wait_until(lambda: self.line("paper").startswith("active for "), "it is active")
        wait_until(lambda: self.line("paper") not in ("active for 0 s", "active for 1 s"), "its age grows")

    def current(self, axis):
        """What the page shows of the axis's driver on a UART."""
        return self.page.find(self.page.axis(axis, '[data-field="chips"]')).text

    def set_currents(self, axis, run, hold):
        for name, current in (("run", run), ("hold", hold)):
            field = self.page.find(self.page.axis(axis, f'.currents [name="{name}"]'))
            field.clear()
            field.send_keys(current)
        self.page.click(self.page.axis(axis, ".currents button"))

    def test_currents_of_a_driver_on_a_uart_are_shown_and_set(self):
        wait_until(lambda: "A (0.80 A moving, 0.40 A at rest)" in self.current("y"),
                   lambda: f"the configured currents; they are {self.current('y')!r}")
        self.assertFalse(self.page.find(self.page.axis("x", ".chips")).is_displayed())
        self.set_currents("y", "0.5", "0.1")
        wait_until(lambda: "(0.49 A moving, 0.09 A at rest)" in self.current("y"),
                   lambda: f"the new currents; they are {self.current('y')!r}")
        self.set_currents("y", "5", "")
        self.page.wait_said("to 0.8 A")
        self.set_currents("y", "", "")
        wait_until(lambda: "(0.80 A moving, 0.40 A at rest)" in self.current("y"), "as configured again")

    def test_the_load_of_a_driver_on_a_uart_is_shown_after_a_motion(self):
        for target in (0.06, 0.02):
            machine.call("y/move_to", MoveTo, position=target, wait=True)
        wait_until(lambda: "load of the last motion " in self.current("y"),
                   lambda: f"the load is shown; there is {self.current('y')!r}")

    def test_setting_zero_asks_first(self):
        self.page.click(self.page.axis("y", '[data-by="1"]'))
        machine.at_rest()
        self.page.click(self.page.axis("y", '[data-do="zero"]'))
        self.page.click(self.page.axis("y", '[data-do="zero-no"]'))
        self.assertFalse(machine.state("y")["position_valid"] and position("y") == 0.0)
        self.page.click(self.page.axis("y", '[data-do="zero"]'))
        self.page.click(self.page.axis("y", '[data-do="zero-yes"]'))
        wait_until(lambda: machine.state("y")["position_valid"] and position("y") == 0.0, "y is at 0")

    def test_hold_resume_and_override(self):
        self.page.driver.execute_script(
            "const o = document.getElementById('override'); o.value = 20; o.dispatchEvent(new Event('change'))")
        wait_until(lambda: abs(machine.override - 0.2) < 1e-6, "the override is 20 %")
        self.begin_long_move()
        self.page.click("#hold")
        wait_until(lambda: machine.state("x")["held"] and not machine.state("x")["moving"], "x is held")
        held = position()
        self.page.click("#resume")
        wait_until(lambda: position() != held, "x continues")
        self.page.click("#stop")
        self.rests()

    def test_emergency_stop_shows_the_fault_and_what_ends_it(self):
        self.page.click("#emergency")
        wait_until(lambda: machine.state("x")["fault"], "x is at fault")
        wait_until(lambda: "x: " in self.page.text("faults") and "recover" in self.page.text("faults"),
                   "the fault and its remedy are shown")
        self.page.click("#recover")
        wait_until(lambda: not machine.state("x")["fault"], "no fault")
        wait_until(lambda: self.page.text("faults") == "", "no fault is shown")


class Stops(OnTheMachine):
    def stops_by(self, act):
        self.begin_long_move()
        act()
        self.rests()
        self.page.wait_said("all axes stop")
        self.assertGreater(abs(position() - self.far), 1.0)

    def test_by_its_button(self):
        self.stops_by(lambda: self.page.click("#stop"))

    def test_by_escape_in_a_field(self):
        def act():
            self.page.find(self.page.axis("x", ".goto input")).send_keys(Keys.ESCAPE)
        self.stops_by(act)

    def test_by_space_also_if_another_button_has_the_focus(self):
        def act():
            pulses = machine.pulses("y")
            self.page.driver.execute_script("arguments[0].focus()", self.page.find(self.page.axis("y", '[data-by="10"]')))
            self.page.keys(Keys.SPACE)
            self.assertEqual(machine.pulses("y"), pulses)
        self.stops_by(act)


    def test_what_is_on_its_way_is_stopped_too(self):
        for number in range(6):
            with self.subTest(number):
                far = 190 if position() < 100 else 1
                self.page.driver.execute_script("""
                    const form = document.querySelector('.axis[data-axis="x"] form');
                    form.querySelector("input").value = arguments[0];
                    form.requestSubmit();
                    document.getElementById("stop").click();""", far)
                self.page.wait_said("")
                begin = machine.rig().time
                # The move takes 1 s or more.
                wait_until(lambda: machine.rig().time > begin + 1.5, "time passes")
                self.rests()
                self.assertGreater(abs(position() - far), 1.0)


class JogByPressAndHold(OnTheMachine):
    def setUp(self):
        super().setUp()
        machine.call("x/move_to", MoveTo, position=0.02, wait=True)
        wait_until(lambda: abs(position() - 20.0) < 0.02 and not machine.state("x")["moving"], "x is at 20 mm")
        self.page.click('[data-share="0.05"]')
        self.plus = self.page.axis("x", '.jog[data-direction="1"]')

    def jogs(self):
        """Holds the button until x moves."""
        for _ in range(PRESSES):
            self.page.hold(self.plus)
            wait_until(lambda: machine.state("x")["moving"] or "Press again" in self.page.said(),
                       "x moves, or the page says why not")
            if machine.state("x")["moving"]:
                return
            self.page.release()
        self.fail(f"x doesn't move: {self.page.said()}")

    def stays(self):
        """Nothing moves by what was sent before."""
        pulses = machine.pulses()
        begin = machine.rig().time
        wait_until(lambda: machine.rig().time > begin + 2 * JOG_TIMEOUT, "time passes")
        self.assertEqual(machine.pulses(), pulses)

    def test_lasts_while_it_is_held(self):
        # Twice as long as a single message would move it.
        for _ in range(PRESSES):
            self.jogs()
            begin, at = position(), machine.rig().time
            wait_until(lambda: machine.rig().time > at + 2 * JOG_TIMEOUT or not machine.state("x")["moving"],
                       "time passes")
            lasted = machine.state("x")["moving"]
            self.page.release()
            self.rests()
            if lasted:
                break
        self.assertTrue(lasted)
        self.assertGreater(position(), begin + 5.0)
        self.stays()

    def test_by_the_enter_key(self):
        self.page.driver.execute_script("arguments[0].focus()", self.page.find(self.plus))
        from selenium.webdriver import ActionChains
        ActionChains(chrome, duration=0).key_down(Keys.ENTER).perform()
        self.moves()
        ActionChains(chrome, duration=0).key_up(Keys.ENTER).perform()
        self.rests()

    def test_ends_when_the_window_loses_the_focus(self):
        self.jogs()
        chrome.execute_script("window.dispatchEvent(new Event('blur'))")
        self.rests()
        self.page.release()

    def test_ends_in_a_hidden_tab(self):
        self.jogs()
        self.addCleanup(close_other_tabs, chrome.current_window_handle)
        chrome.switch_to.new_window("tab")
        self.rests()

    def test_ends_with_the_page(self):
        self.jogs()
        chrome.get("about:blank")
        self.rests()

    def test_ends_without_the_network_and_late_messages_move_nothing(self):
        link = machine.link.replace(f":{machine.port}/", f":{network.port}/")
        self.page.open_live(link)
        self.page.take_control()
        self.page.click('[data-share="0.05"]')
        self.jogs()
        network.cut()
        cut = machine.rig().time
        self.rests()
        after = machine.last_pulse("x") - cut
        print(f"the last pulse came {after:.3f} s after the network was cut; jog_timeout is {JOG_TIMEOUT} s")
        self.assertLess(after, JOG_TIMEOUT + SLOWING + LATE)
        network.mend()
        self.stays()
        wait_until(self.page.is_live, "the page is connected again")
        self.assertFalse(machine.state("x")["moving"])
        self.page.release()

    def test_ends_if_the_panel_hangs(self):
        self.jogs()
        process = machine.panel_process()
        os.kill(process, signal.SIGSTOP)
        self.addCleanup(os.kill, process, signal.SIGCONT)
        stopped = machine.rig().time
        self.rests()
        after = machine.last_pulse("x") - stopped
        print(f"the last pulse came {after:.3f} s after the panel was stopped; jog_timeout is {JOG_TIMEOUT} s")
        self.assertLess(after, JOG_TIMEOUT + SLOWING + LATE)
        os.kill(process, signal.SIGCONT)
        self.stays()
        self.page.release()

    def test_control_comes_back_with_the_connection(self):
        self.page.open_live(machine.link.replace(f":{machine.port}/", f":{network.port}/"))
        self.page.take_control()
        network.cut()
        wait_until(lambda: self.page.text("connection") == "not connected", "the page notices")
        network.mend()
        wait_until(self.page.is_live, "the page is connected again")
        self.assertFalse(self.page.find("#control").is_displayed())

    def test_what_is_clicked_without_a_connection_does_nothing_later(self):
        self.page.open_live(machine.link.replace(f":{machine.port}/", f":{network.port}/"))
        self.page.take_control()
        network.cut()
        wait_until(lambda: self.page.text("connection") == "not connected", "the page notices")
        pulses = machine.pulses()
        self.page.click(self.page.axis("x", '[data-by="1"]'))
        self.page.wait_said("nothing was sent")
        network.mend()
        wait_until(self.page.is_live, "the page is connected again")
        self.stays()
        self.assertEqual(machine.pulses(), pulses)


class TwoPages(OnTheMachine):
    def setUp(self):
        super().setUp()
        self.first = chrome.current_window_handle
        chrome.switch_to.new_window("tab")
        self.page.open_live(machine.link)

    def tearDown(self):
        close_other_tabs(self.first)

    def test_the_second_watches_and_stops_and_takes_over(self):
        pulses = machine.pulses()
        self.assertIn("Another page has control", self.page.text("control-text"))
        self.page.click(self.page.axis("x", '[data-by="1"]'))
        self.page.wait_said("another page has control; take it over first")
        self.assertEqual(machine.pulses(), pulses)
        self.page.click("#stop")
        self.page.wait_said("all axes stop")
        self.page.take_control()
        self.page.click(self.page.axis("x", '[data-by="1"]'))
        wait_until(lambda: machine.pulses() > pulses, "the page moves x")
        chrome.switch_to.window(self.first)
        wait_until(lambda: "Another page has control" in self.page.text("control-text"), "the first one is told")
