# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser, on the real simulator: what a person does with it, and what comes of it."""

import math
import re
import subprocess
from dataclasses import dataclass

import pytest
from playwright.sync_api import expect
from test_viewer_page_control import drag
from viewer_page_rig import Visit, until

from kurumaisu.bench import processes
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.chair.simulator import ChairSimulator
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.world import load_world

WORLD = """
model ( name "room" size [8 8 1] boundary 1 noblocks 1 color "gray30" )
model ( name "crate" pose [2 -2 0 0] size [0.6 0.6 0.8] color "tan" )
position ( name "chair" pose [-2 0 0 0] )
"""
PATIENCE = 60.0  # [s] of the wall's clock for what a busy machine simulates


@dataclass(frozen=True)
class Simulator:
    """A page that commands sim_node, and the environment in which others find its master."""

    visit: Visit
    environment: dict

    @property
    def page(self):
        return self.visit.page

    def choose(self, name):
        """Choose a body by its name; return where it is, x, y [m], yaw [deg]."""
        select, pose = self.page.locator("#body-select"), self.page.locator("#body-pose")
        if self.page.locator("#tab-body").get_attribute("aria-selected") == "false":
            self.page.locator("#tab-body").click()
        option = select.locator("option", has_text=f"{name} (")
        expect(option).to_have_count(1)
        select.select_option(label=option.text_content())
        expect(pose).to_have_text(re.compile("m,"))
        return [float(number) for number in re.findall(r"[-\d.]+", pose.text_content().replace("−", "-"))]

    def bodies(self):
        return {text.split(" (")[0] for text in self.page.locator("#body-select option").all_text_contents()}


@pytest.fixture(autouse=True, scope="module")
def patient():
    """Wait longer than for a page alone."""
    expect.set_options(timeout=1000 * PATIENCE)
    yield
    expect.set_options(timeout=5000)


@pytest.fixture(scope="module")
def simulator(patient, browser, tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    world, log = folder / "room.world", folder / "log"
    world.write_text(WORLD)
    launch = ["roslaunch", "kurumaisu", "sim.launch", f"world:={world}", "viewer:=true", "viewer_port:=0"]
    with processes.master() as environment, processes.running(launch, log, environment):
        link = until(lambda: re.search(r"http://\S+#token=\S+", log.read_text()), "the page's address", PATIENCE)[0]
        with Visit(browser, link) as visit:
            expect(visit.page.locator("#box")).to_be_enabled()
            yield Simulator(visit, environment)


def test_obstacles_are_drawn_taken_back_and_brought_back(simulator, tmp_path):
    page = simulator.page
    page.locator("#box").click()
    drag(simulator.visit, (-0.5, 2.0), (0.5, 3.0))
    page.locator("#wall").click()
    drag(simulator.visit, (-3.0, -2.0), (-0.2, -2.0))
    page.locator("#person").click()
    drag(simulator.visit, (2.0, 0.0), (2.0, 3.0))
    assert simulator.choose("box 1") == pytest.approx([0.0, 2.5, 0.0], abs=0.03)
    assert simulator.choose("wall 1") == pytest.approx([-1.6, -2.0, 0.0], abs=0.03)  # longer than 2 m, but added
    until(lambda: simulator.choose("person 1")[1] > 0.5, "the person walks", PATIENCE)
    page.screenshot(path=tmp_path / "added.png")
    page.keyboard.press("Escape")
    for _ in range(3):
        page.locator("#undo").click()
    until(lambda: simulator.bodies() == {"none", "crate", "chair"}, "all taken back", PATIENCE)
    page.locator("#redo").click()
    assert simulator.choose("box 1") == pytest.approx([0.0, 2.5, 0.0], abs=0.03)
    page.locator("#wall").click()
    drag(simulator.visit, (-2.0, -1.0), (-2.0, 1.0))
    expect(page.locator("#alarm")).to_contain_text("wall 2: the chair is in the way")
    page.keyboard.press("Escape")


def test_a_goal_is_published_and_the_simulated_chair_drives_there(simulator, tmp_path):
    page, heard = simulator.page, tmp_path / "goal"
    echo = ["rostopic", "echo", "-n", "1", "/move_base_simple/goal"]
    with processes.running(echo, heard, simulator.environment) as listener:

        def ended():  # as it does with the first goal that it hears
            page.locator("#goal").click()
            drag(simulator.visit, (0.5, 0.5), (0.5, 1.5))
            expect(page.locator("#toast")).to_contain_text("published on /move_base_simple/goal")
            return listener.poll() is not None

        until(ended, "somebody hears of the goal", PATIENCE)
    text = heard.read_text()
    assert 'frame_id: "map"' in text
    x, y, _z, _x, _y, z, w = (float(number) for number in re.findall(r" [xyzw]: (\S+)", text))
    assert (x, y, 2 * math.atan2(z, w)) == pytest.approx((0.5, 0.5, math.pi / 2), abs=0.03)
    page.locator("#go").click()
    expect(page.locator("#goal-text")).to_have_text("chair: driving there")
    page.screenshot(path=tmp_path / "driving.png")
    expect(page.locator("#goal-text")).to_have_text("chair: arrived")
    assert simulator.choose("chair") == pytest.approx([0.5, 0.5, 90.0], abs=4.0)
    assert math.dist(simulator.choose("chair")[:2], (0.5, 0.5)) < 0.2
    page.locator("#forget-goal").click()
    expect(page.locator("#goal-box")).to_be_hidden()


def test_a_saved_world_is_read_again_with_all_where_it_was(simulator, tmp_path):
    page = simulator.page
    page.locator("#pause").click()
    expect(page.locator("#pause")).to_have_text("Run")
    page.locator("#wall").click()
    drag(simulator.visit, (-3.0, -3.0), (-0.2, -2.0))
    simulator.choose("wall 2")  # the name of what was taken back is kept for it
    page.keyboard.press("Escape")
    drag(simulator.visit, (2.0, -2.0), (2.5, -3.0))
    until(
        lambda: simulator.choose("crate")[:2] == pytest.approx([2.5, -3.0], abs=0.03), "the crate was dragged", PATIENCE
    )
    here = {name: simulator.choose(name) for name in ("chair", "crate", "wall 2", "box 1")}
    with page.expect_download() as download:
        page.locator("#save-world").click()
    download.value.save_as(tmp_path / "saved.world")
    page.locator("#pause").click()
    checked = subprocess.run(
        [processes.program("check-world"), tmp_path / "saved.world"], capture_output=True, text=True
    )
    assert (checked.returncode, checked.stderr) == (0, ""), checked.stdout
    world = load_world(tmp_path / "saved.world")
    poses = {m.name: pose for m, pose in zip(world.models, world.poses, strict=True)}
    for name, (x, y, degrees) in here.items():
        assert poses[name][:2] == pytest.approx([x, y], abs=6e-4), name
        assert math.degrees(poses[name][3]) == pytest.approx(degrees, abs=0.06), name
    model, dynamics = load_model(shipped("launch/md100.yaml")), load_dynamics(shipped("launch/physical.yaml"))
    chair = ChairSimulator(model, world, dynamics)
    assert chair.chair_pose[:2] == pytest.approx(here["chair"][:2], abs=6e-4)


def test_the_frames_of_tf_are_listed(simulator, tmp_path):
    page = simulator.page
    page.locator("#tab-view").click()
    page.locator("#frames-list").click()
    rows = page.locator("#frames-tree li")
    expect(rows.first).to_have_text("odomroot")
    expect(rows.nth(1)).to_have_text(re.compile(r"base_link\d+\.\d Hz, /base_node"))
    expect(rows.filter(has_text="laserstatic")).to_have_count(1)
    page.screenshot(path=tmp_path / "frames.png")
