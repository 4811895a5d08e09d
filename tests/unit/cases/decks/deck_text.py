"""A small deck for modification: two cubes, the upper one pressed down."""

from case_texts import square

import fastcontact as fc


def static_steps(*lines):
    """Return the steps of a deck, one for each of the given texts."""
    return "".join(f"*Step\n*Static\n{own}*End Step\n" for own in lines)


NODES = f"""*Heading
 two cubes
*Node
{square(1, 0)}{square(5, 1)}{square(11, 1)}{square(15, 2)}*Element, type=C3D8, elset=low
1, 1, 2, 3, 4, 5, 6, 7, 8
*Element, type=C3D8, elset=up
2, 11, 12, 13, 14, 15, 16, 17, 18
*Nset, nset=bottom, generate
1, 4
*Nset, nset=top
15, 16, 17, 18
*Nset, nset=x0
1, 4, 5, 8, 11, 14, 15, 18
*Nset, nset=y0
1, 2, 5, 6, 11, 12, 15, 16
*Surface, name=sm, type=ELEMENT
low, S2
*Surface, name=ss
up, S1
*Surface, name=roof
up, S2
"""
MATERIAL = """*Material, name=steel
*Elastic
200000., 0.
*Solid Section, elset=low, material=steel
*Solid Section, elset=up, material=steel
"""
CONTACT = """*Surface Interaction, name=si
*Contact Pair, interaction=si, type=SURFACE TO SURFACE
ss, sm
"""
SUPPORTS = """*Boundary
bottom, 3
x0, 1
y0, 2
"""
STEP = static_steps("*Dsload\nroof, P, 100.\n")
WHOLE = NODES + MATERIAL + CONTACT + SUPPORTS + STEP


def deck_of(folder, text, name="deck.inp"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return fc.read_deck(path)
