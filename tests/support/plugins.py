"""A method as a stranger writes it."""

SOURCE = """import evenhand as ev


@ev.method("mine", strength=0.3)
class Mine:
    def begin(self, scheme):
        return None

    def teach(self, epoch, memory):
        return epoch.reward - self.strength * (epoch.x == 1).sum(axis=1), memory
"""
