"""eaid: the workbench for electroadhesive clutches."""

__version__ = "0.1.0"
