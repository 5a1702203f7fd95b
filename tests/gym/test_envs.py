"""The environments keep Gymnasium's contract, alone and in a batch, and their episodes are those of trials."""

import copy
import dataclasses
import pickle
import sys
from importlib import reload

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import RecordEpisodeStatistics
from gymnasium.wrappers.vector import RecordEpisodeStatistics as RecordBatchStatistics

import chilopod.gym
from chilopod import load_robot
from chilopod.errors import ChilopodError, ExtraError, ParameterError
from chilopod.gym import Episodes, OneTarget, Rewards, RobotEnv, Steered, baseline, episodes
from chilopod.paper import printed
from chilopod.steering import SpringLaw, Target, random_course
from chilopod.trials import NONE, Disturbance, Trial, run

TURN, COURSE = "chilopod/Turn-v0", "chilopod/Course-v0"
SHORT = {"patience": 32.0}
FOUR = pytest.mark.parametrize(
    ("name", "engine"), [(name, engine) for name in (TURN, COURSE) for engine in ("planar", "twin")]
)


@FOUR
def test_gymnasium_finds_nothing_wrong(name, engine):
    check_env(gymnasium.make(name, engine=engine).unwrapped)


@pytest.mark.parametrize("task", ["A", "B"])
def test_the_tasks_of_the_paper_are_its_targets_and_are_arrived_at(task):
    name = f"chilopod/Task{task}-v0"
    check_env(gymnasium.make(name).unwrapped)
    batch = gymnasium.make_vec(name, num_envs=3)
    wanted = printed.TASKS[task].target
    assert batch.unwrapped.episodes.task.target == wanted
    (seen, info), policy = batch.reset(seed=2), baseline("variable", batch.unwrapped.episodes)
    np.testing.assert_allclose(info["distance"], wanted.distance, rtol=1e-12)
    # A robot is disturbed as in a trial of its seed, and the target is where it is.
    (record,) = run([Trial(load_robot("aoi2022-planar"), 0.01, 3, target=wanted)])
    assert info["distance"][1] == pytest.approx(record.distance.values[0, 0])
    assert info["pose"][1, 2] == pytest.approx(record.heading.values[0, 0])
    ends = np.full(3, "", dtype="U12")
    while not all(ends):
        seen, _, terminated, _, info = batch.step(policy(seen))
        ends = np.where(ends == "", info["verdict"], ends)
        assert (terminated | (info["distance"] > 0.15) | (ends != "")).all()
    assert ends.tolist() == ["arrived"] * 3


@dataclasses.dataclass(frozen=True)
class Straight(OneTarget):
    """A task of one's own: ahead, without a reward, over after three steps."""

    def reward(self, look):
        return np.zeros(len(look.busy))

    def ending(self, look):
        return look.busy & (look.left < 40.0 - 3 * 0.6 + 1e-9), look.judged.gone


def test_a_task_of_one_s_own_is_a_class():
    env = RobotEnv(task=Straight(target=Target(0.0, 1.0)), patience=40.0)
    _, info = env.reset(seed=0)
    assert info["distance"] == pytest.approx(1.0)
    assert [env.step(np.zeros(3))[1:4] for _ in range(3)] == [(0.0, over, False) for over in (False, False, True)]


def towards(seen):
    """A policy that arrives: soft where the target is aside and the body straight."""
    bearing, bend = np.arctan2(seen[:, 1], seen[:, 2]), seen[:, 4:9].sum(axis=1)
    spring = np.tanh(-0.3 - np.abs(bearing) - np.sign(bearing) * bend)
    return np.column_stack([spring, np.tanh(bearing), np.tanh(bearing)]).astype(np.float32)


def acted(env, steps, seed):
    """Observations, rewards, ends and infos of random actions, one after the other."""
    random = np.random.default_rng(0)
    told = [env.reset(seed=seed)]
    for _ in range(steps):
        told.append(env.step(random.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)))
    return told


@pytest.mark.parametrize(("engine", "steps"), [("planar", 8), ("twin", 2)])
def test_a_robot_of_a_batch_has_the_episode_of_one_that_is_alone_with_its_seed(engine, steps):
    batch = gymnasium.make_vec(COURSE, num_envs=3, engine=engine, springs="all")
    told = acted(batch, steps, seed=5)
    for robot in range(3):
        alone = gymnasium.make(COURSE, engine=engine, springs="all")
        np.testing.assert_array_equal(alone.reset(seed=5 + robot)[0], told[0][0][robot])
        actions = np.random.default_rng(0)
        for step in told[1:]:
            action = actions.uniform(-1.0, 1.0, batch.action_space.shape).astype(np.float32)[robot]
            observation, reward, terminated, truncated, info = alone.step(action)
            np.testing.assert_array_equal(observation, step[0][robot])
            assert (reward, terminated, truncated) == tuple(each[robot] for each in step[1:4])
            for key, value in info.items():
                np.testing.assert_array_equal(value, step[4][key][robot])


def test_later_episodes_are_those_of_gymnasium_s_own_vectorisation():
    batch, others = (gymnasium.make_vec(TURN, num_envs=2, vectorization_mode=mode, **SHORT) for mode in (None, "sync"))
    assert batch.metadata["autoreset_mode"] is others.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen, _ = batch.reset(seed=3)
    other, _ = others.reset(seed=3)
    over = 0
    for _ in range(60):
        actions = towards(seen)
        seen, *judged, info = batch.step(actions)
        other, *also, there = others.step(actions)
        # Times of a walk that goes on are rounded otherwise than those of one that has just begun.
        np.testing.assert_allclose(seen, other, rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(judged[0], also[0], rtol=0.0, atol=1e-6)
        np.testing.assert_array_equal(judged[1:], also[1:])
        assert info.keys() == there.keys()
        assert info["verdict"].tolist() == there["verdict"].tolist()
        over += int(np.sum(judged[1:]))
    assert over >= 2


def test_the_first_episode_of_a_seed_is_the_course_and_the_disturbance_of_trials():
    env = gymnasium.make(COURSE, disturbance=NONE).unwrapped
    seen, info = env.reset(seed=7)
    goal = random_course(7, 1.0).goals[0]
    assert info["distance"] == pytest.approx(np.hypot(goal.x, goal.y))
    assert seen[1:3] == pytest.approx(np.array([goal.y, goal.x]) / info["distance"], abs=1e-6)
    assert seen[3] == pytest.approx(info["distance"], abs=1e-6)
    np.testing.assert_array_equal(seen[4:11], 0.0)


def test_spaces_are_bounded_and_hold_what_comes():
    batch = gymnasium.make_vec(TURN, num_envs=4, springs="all", disturbance=Disturbance(missed=0.5))
    space = batch.single_observation_space
    assert np.isfinite([space.low, space.high]).all()
    for seen, *_ in acted(batch, 6, seed=0):
        assert batch.observation_space.contains(seen)
    names, actions = batch.unwrapped.episodes.sight.names, batch.unwrapped.episodes.actions
    assert len(names) == space.shape[0] == 16
    assert len(actions.names) == batch.single_action_space.shape[0] == 7


def test_a_robot_that_breaks_ends_its_episode_and_its_neighbour_walks_on():
    # Joints that nothing holds.
    weak = load_robot("aoi2022-planar").set_from_text(
        ["springs.adjustable[0]=true", "springs.softest=0.001 N*mm/deg", "body.yaw_inertia=2.4 kg*cm^2"]
    )
    batch = gymnasium.make_vec(TURN, num_envs=2, robot=weak)
    batch.reset(seed=0)
    ended = None
    for _ in range(50):
        seen, reward, terminated, _, info = batch.step(np.array([[-1, 1, 1], [1, 0, 0]], dtype=np.float32))
        if terminated[0]:
            ended = reward[0], info["verdict"][0], np.isfinite(seen).all()
            break
    assert ended is not None
    assert ended[0] < -0.9
    assert ended[1:] == ("stopped", True)
    assert not terminated[1]
    seen, reward, *_ = batch.step(np.zeros((2, 3), dtype=np.float32))
    assert reward[0] == 0.0
    assert np.isfinite(seen).all()


FOLDS = np.array([-1, 1, 1], dtype=np.float32)


def gained(env, action):
    """Rewards until the episode ends, with one action all along, and whether the robot walked to the end."""
    total, over = 0.0, False
    while not over:
        _, reward, terminated, truncated, info = env.step(np.float32(action))
        total, over = total + reward, terminated or truncated
    return total, info["verdict"] != "stopped"


@pytest.mark.parametrize(("name", "named"), [(TURN, {}), (COURSE, {"targets": 2})])
def test_folding_is_no_way_out(name, named):
    """Whatever a robot does that does not fold after all, and walks on to the end of its time, gains more."""
    env = gymnasium.make(name, **named).unwrapped
    env.reset(seed=3)
    before = []
    while True:
        before.append(copy.deepcopy(env))
        if env.step(FOLDS)[2]:
            break
    here = before[-4]
    folded, _ = gained(copy.deepcopy(here), FOLDS)
    ends = [gained(copy.deepcopy(here), action) for action in ([1, 0, 0], [1, 1, 1], [1, -1, -1], [0.5, -1, -1])]
    assert all(walked for _, walked in ends)
    assert all(total > folded + 0.5 for total, _ in ends)


def test_a_failure_is_charged_with_the_time_that_was_left():
    env = gymnasium.make(COURSE, patience=30.0, targets=3).unwrapped
    env.reset(seed=1)  # a target to the right
    gait, cycles, over = env.episodes.robot.gait, 0, False
    while not over:
        _, reward, over, _, info = env.step(FOLDS)
        cycles += 1
    left = 3 * 30.0 - cycles * gait.period  # the time of no target was over
    assert (info["verdict"], info["arrived"], cycles < 50) == ("stopped", 0, True)
    assert reward == pytest.approx(-1.01 - (0.01 / gait.period + gait.speed) * left)


@pytest.mark.parametrize("engine", ["planar", "twin"])
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_a_copy_of_an_environment_goes_on_to_the_same_bits(engine, copied):
    batch = gymnasium.make_vec(TURN, num_envs=2, engine=engine).unwrapped
    alone = gymnasium.make(TURN, engine=engine, render_mode="rgb_array").unwrapped
    for env in (batch, alone):
        before = copied(env)  # before the first episode
        action = np.full(env.action_space.shape, 0.7, dtype=np.float32)
        for each in (env, before):
            each.reset(seed=1)
            each.step(action)
            each.render()
        twins = [env, before, copied(env)]
        found = [[each.step(action) for _ in range(2)] for each in twins]
        for other in found[1:]:
            for one, step in zip(found[0], other, strict=True):
                np.testing.assert_array_equal(one[0], step[0])
                np.testing.assert_array_equal(one[1:4], step[1:4])
        assert len({str(each.np_random.bit_generator.state) for each in twins}) == 1
    assert len({each.render().tobytes() for each in twins}) == 1


def test_time_that_is_over_truncates():
    env = gymnasium.make(TURN, patience=32.4).unwrapped
    env.reset(seed=2)  # a target to the right
    steps = [env.step(np.ones(3, dtype=np.float32)) for _ in range(54)]
    assert [each[3] for each in steps] == [False] * 53 + [True]
    assert steps[-1][4]["verdict"] == "out of time"
    with pytest.raises(ParameterError, match="must not follow the end of an episode"):
        env.step(np.zeros(3, dtype=np.float32))


def test_a_walk_that_is_as_long_as_walks_may_be_begins_again(monkeypatch):
    monkeypatch.setattr(episodes, "LONGEST", 1.5)
    batch = gymnasium.make_vec(TURN, num_envs=2)
    batch.reset(seed=0)
    ends = [batch.step(np.zeros((2, 3), dtype=np.float32))[3].tolist() for _ in range(5)]
    assert ends == [[False, False], [True, True], [False, False], [False, False], [True, True]]


def test_seeds_may_be_one_each_and_numpy_s():
    batch = gymnasium.make_vec(TURN, num_envs=2)
    first, _ = batch.reset(seed=np.int64(3))
    np.testing.assert_array_equal(first, batch.reset(seed=[np.int64(3), 4])[0])
    np.testing.assert_array_equal(first, batch.reset(seed=np.array([3, 4]))[0])
    np.testing.assert_array_equal(first, batch.reset(seed=np.array(3))[0])
    alone = gymnasium.make(TURN).unwrapped
    np.testing.assert_array_equal(first[0], alone.reset(seed=np.array(3))[0])
    wrong = [(batch, [3]), (batch, "ab"), (batch, b"ab"), (batch, "a"), (batch, [-1, 2])]
    for env, seed in [*wrong, *((each, one) for each in (batch, alone) for one in (1.5, -1, "a", {}, True))]:
        with pytest.raises(ParameterError, match="seed") as caught:
            env.reset(seed=seed)
        assert "\n" not in str(caught.value)
        assert not str(caught.value).startswith("seed = 1:")


def test_wrappers_of_gymnasium_go_with_both():
    batch = RecordBatchStatistics(gymnasium.make_vec(TURN, num_envs=2, **SHORT))
    alone = RecordEpisodeStatistics(gymnasium.make(TURN, **SHORT))
    (seen, _), (one, _) = batch.reset(seed=[3, 4]), alone.reset(seed=3)
    found = None
    for _ in range(54):
        seen, _, _, _, infos = batch.step(towards(seen))
        if found is None:
            one, _, terminated, truncated, info = alone.step(towards(one[None])[0])
            if terminated or truncated:
                found = info["episode"]
                assert infos["episode"]["l"][0] == found["l"]
                assert infos["episode"]["r"][0] == pytest.approx(found["r"])
    assert found is not None


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ([0.0, 1.5, 0.0], r"action\[1\] = 1\.5: the yaw of the left leg is out of range.*-1 to 1"),
        ([np.nan, 0.0, 0.0], r"action\[0\] = nan: the spring of joint 1 is out of range"),
        ([0.0, 0.0], r"action\.shape = \(2,\): must be \(3,\), the numbers spring of joint 1, yaw of"),
        ("left", "action"),
    ],
)
def test_an_action_that_is_none_is_one_line(action, words):
    env = gymnasium.make(TURN, disable_env_checker=True).unwrapped
    with pytest.raises(ParameterError, match="must not be called before the first reset"):
        env.step(np.zeros(3, dtype=np.float32))
    other = gymnasium.make(TURN, disable_env_checker=True).unwrapped
    env.reset(seed=0)
    other.reset(seed=0)
    with pytest.raises(ParameterError, match=words) as caught:
        env.step(action)
    assert "\n" not in str(caught.value)
    good = np.array([0.0, 1.0, 0.5], dtype=np.float32)
    np.testing.assert_array_equal(env.step(good)[0], other.step(good)[0])


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ({"engine": "planer"}, "planar"),
        ({"robot": "aoi2021"}, "aoi2021"),
        ({"robot": "aoi2022-planar", "engine": "twin"}, "twin"),
        ({"springs": "second"}, "first or all"),
        ({"patience": 3.0}, "long enough"),
        ({"render_mode": "human"}, "rgb_array"),
        *(({"targets": targets}, "targets.*1 to 1000") for targets in (10**9, -1, 0, 1.5, "1", None)),
        ({"patience": np.nan}, "patience"),
        ({"engine": 5}, "engine = 5: must be a name.*planar, twin"),
        ({"engine": ["planar"]}, "must be a name"),
        ({"robot": 5}, "robot = 5"),
        ({"disturbance": 5}, "disturbance = 5: must be a Disturbance"),
        ({"disturbance": Disturbance(slick=(7, 1))}, r"slick = \(7, 1\): must be a foot of the robot"),
        ({"rewards": 5}, "rewards = 5: must be a Rewards"),
        ({"task": "Tern"}, "must be one of the tasks; did you mean 'Turn'. allowed: Turn, Course, TaskA, TaskB"),
        ({"task": 5}, "task = 5: must be one of the tasks"),
        (
            {"task": "TaskA", "targets": 2},
            "targets = 2: must be a field of OneTarget or an argument; did you mean 'target'",
        ),
        ({"pateince": 20}, r"did you mean 'patience'\? allowed: rewards, targets, task, robot, engine, springs, pat"),
        ({"task": "TaskA", "target": 5}, "target = 5: must be a Target"),
    ],
)
def test_an_environment_that_cannot_be_is_one_line(named, words):
    with pytest.raises(ChilopodError, match=words) as caught:
        RobotEnv(**named)
    assert "\n" not in str(caught.value)


def test_springs_without_an_actuator_or_a_range_are_refused():
    robot = load_robot("aoi2022-planar")
    fixed = robot.override("springs.adjustable[1]", True)
    narrow = robot.set_from_text(["springs.adjustable[0]=true", "springs.softest=99 N*mm/deg"])
    for each, words in ((fixed, "must be true"), (narrow, "a range")):
        with pytest.raises(ParameterError, match=words):
            Episodes(each)


def test_without_gymnasium_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(ExtraError, match=r"chilopod\[gym\]"):
        reload(chilopod.gym)
    monkeypatch.undo()
    reload(chilopod.gym)


def test_pictures_follow_the_robot():
    batch = gymnasium.make_vec(TURN, num_envs=2, render_mode="rgb_array")
    assert [each.min() for each in batch.render()] == [255, 255]
    batch.reset(seed=0)
    first = batch.render()
    batch.step(np.zeros((2, 3), dtype=np.float32))
    second = batch.render()
    assert [each.shape for each in second] == [(480, 480, 3)] * 2
    assert all((a != b).any() for a, b in zip(first, second, strict=True))
    assert gymnasium.make(TURN).unwrapped.render() is None


def test_controllers_as_policies_do_what_they_do_with_what_is_seen():
    episodes = gymnasium.make_vec(TURN, num_envs=3, disturbance=NONE).unwrapped.episodes
    rows = episodes.begin([np.random.default_rng()] * 3, [1, 2, 3]).observation
    seen, joints, limit = episodes.sight.seen(rows), episodes.robot.body.modules - 1, np.radians(5.0)
    curvatures, springs = np.array([0.0, 4.0]), np.array([0.7, 0.4])
    law = SpringLaw(0.4, 2.3, curvatures, springs, 0.25, 1.1, 0.45)
    legs, both = baseline("leg-yaw", episodes)(rows), Steered(law, episodes)(rows)
    yaw = np.clip(seen.bearing / limit, -1.0, 1.0)
    np.testing.assert_allclose(legs, np.column_stack([np.ones(3), yaw, yaw]), atol=1e-6)
    np.testing.assert_array_equal(both[:, 1:], legs[:, 1:])
    np.testing.assert_allclose(episodes.actions.stiffness(both.astype(float))[:, 0], law.spring(seen), rtol=1e-6)
    np.testing.assert_array_equal(Steered(law, episodes)(rows[0]), both[0])
    assert seen.joint_angles.shape == (3, joints)
    with pytest.raises(ParameterError, match="leg-yaw"):
        baseline("leg-jaw", episodes)


@pytest.mark.parametrize("count", [0, -1, 1.5, "2", 10**9])
def test_a_batch_has_a_number_of_robots(count):
    with pytest.raises(ParameterError, match=r"num_envs.*(must be a whole number|is too large)"):
        chilopod.gym.RobotVectorEnv(num_envs=count)


def test_single_robots_of_a_vector_are_not_reset():
    robots = chilopod.gym.RobotVectorEnv(num_envs=2)
    with pytest.raises(ParameterError, match=r"reset_mask.*must be left out.*each robot begins again"):
        robots.reset(options={"reset_mask": np.array([True, False])})


@pytest.mark.parametrize("env", [RobotEnv, chilopod.gym.RobotVectorEnv])
def test_options_of_a_reset_are_refused(env):
    robot = env()
    robot.reset(options={})
    with pytest.raises(ParameterError, match=r"options = \['task', 'speed'\]: must be left out; allowed: none"):
        robot.reset(options={"task": "hold", "speed": 0.2})


def test_episodes_that_no_memory_holds_are_refused(monkeypatch):
    monkeypatch.setattr(episodes.memory, "available", lambda: 1e6)
    with pytest.raises(ParameterError, match=r"num_envs \* targets \* patience.*of memory"):
        chilopod.gym.RobotVectorEnv(num_envs=1000, targets=50)


@pytest.mark.parametrize("worth", [np.nan, "1", None, np.inf])
def test_rewards_are_numbers(worth):
    with pytest.raises(ParameterError, match="arrival"):
        Rewards(arrival=worth)


@dataclasses.dataclass(frozen=True)
class Wrong(Straight):
    """A task whose reward has the wrong shape, or is no number."""

    shape: int = 7

    def reward(self, look):
        return np.full(self.shape, np.nan)


@pytest.mark.parametrize(("shape", "problem"), [(7, "must give one reward for each robot"), (1, "must give finite")])
def test_a_reward_that_is_none_is_refused(shape, problem):
    env = RobotEnv(task=Wrong(target=Target(0.0, 1.0), shape=shape))

    def begin_and_step():
        env.reset(seed=0)
        env.step(np.zeros(3))

    with pytest.raises(ParameterError, match=problem):
        begin_and_step()
