"""The adaptable anatomy model and its fitting to one subject.

``anatomy`` is the template as data, ``model`` moves it; ``match`` finds what of a cloud belongs to it, ``search`` where
it is, ``fit`` adapts it; a ``subject`` is the outcome. ``template_builder`` made the templates that ship.
"""
