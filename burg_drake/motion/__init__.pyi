from .planner import Planner as Planner
