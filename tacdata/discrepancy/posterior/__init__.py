"""The posterior over sets of effects: which are missing, with which probability?"""
