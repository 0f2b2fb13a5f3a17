"""Zones and rules: positions of people in, events out. No clock, no socket, no configuration file."""

from server.rules.evaluator import Circumstances, PeopleOfFrame, RuleEvaluator
from server.rules.rules import Direction, Phase, Rule, RuleEvent, RuleKind
from server.rules.schedule import DAYS, Schedule
from server.rules.zones import Area, Line, Zone

__all__ = [
    "DAYS",
    "Area",
    "Circumstances",
    "Direction",
    "Line",
    "PeopleOfFrame",
    "Phase",
    "Rule",
    "RuleEvaluator",
    "RuleEvent",
    "RuleKind",
    "Schedule",
    "Zone",
]
