# The public names for type checkers. `__init__.py` reads them from this file, and imports their modules on first use.

from fastcontact.contact.obstacles._obstacle import Obstacle as Obstacle
from fastcontact.contact.obstacles.meshed import MeshedSurface as MeshedSurface
from fastcontact.contact.obstacles.shapes import SHAPES as SHAPES
from fastcontact.contact.obstacles.shapes import Cylinder as Cylinder
from fastcontact.contact.obstacles.shapes import FlatPunch as FlatPunch
from fastcontact.contact.obstacles.shapes import HalfSpace as HalfSpace
from fastcontact.contact.obstacles.shapes import Height as Height
from fastcontact.contact.obstacles.shapes import Sphere as Sphere
from fastcontact.contact.obstacles.shapes import cone as cone
from fastcontact.contact.obstacles.shapes import paraboloid as paraboloid
