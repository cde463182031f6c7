"""Decks from plate, laminate, projectile and contact as objects, and decks with other values.

- A new deck: ``deck_options`` declares its values and ``new_deck`` makes it, with ``mesh``,
  ``zones``, ``energy`` and ``numerics``. ``plate``, ``laminate`` and ``contact`` have the objects.
- Another deck: ``values`` has the table of values by name and applies them. Its setters are in
  ``plate_values``, ``strike_values`` and ``time_values``. ``changes`` also replaces objects.
- ``case`` and ``parameters`` have the checks of both and their errors.
"""
