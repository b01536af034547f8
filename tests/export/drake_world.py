"""An exported scene in Drake, by nothing but Drake's own parsers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import LoadModelDirectives, Parser, ProcessModelDirectives
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from burg_drake.core import Array


@dataclass
class DrakeWorld:
    """A simulation of a scene."""

    plant: MultibodyPlant
    scene_graph: SceneGraph
    simulator: Simulator

    def body(self, name: str) -> RigidBody:
        """The one body of a model."""
        model = self.plant.GetModelInstanceByName(name)
        (index,) = self.plant.GetBodyIndices(model)
        return self.plant.get_body(index)

    def X_WB(self, name: str) -> Array:
        """(4, 4) pose of the body of a model."""
        context = self.plant.GetMyContextFromRoot(self.simulator.get_context())
        return self.plant.EvalBodyPoseInWorld(context, self.body(name)).GetAsMatrix4()


def open_in_drake(file: Path) -> DrakeWorld:
    """Loads an SDF or directives."""
    config = MultibodyPlantConfig(
        time_step=0.002,
        contact_model="hydroelastic_with_fallback",
        discrete_contact_approximation="lagged",
    )
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    if file.suffix == ".yaml":
        parser.package_map().AddPackageXml(str(file.parent / "package.xml"))
        ProcessModelDirectives(LoadModelDirectives(str(file)), plant, parser)
    else:
        parser.AddModels(str(file))
    plant.Finalize()
    return DrakeWorld(plant, scene_graph, Simulator(builder.Build()))
