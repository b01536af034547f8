from .runs import unite as unite
