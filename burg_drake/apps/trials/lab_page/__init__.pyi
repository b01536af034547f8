from .server import LabServer as LabServer
