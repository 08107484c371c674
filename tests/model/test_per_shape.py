"""What is found for shapes that several maps have."""

import shapely

from rose2_logs.model.per_shape import PerShape


def test_only_shapes_that_the_map_before_did_not_have_are_asked_about():
    asked = []

    def area(shapes):
        asked.append(len(shapes))
        return shapely.area(shapes).tolist()

    areas = PerShape(area)
    small, large = shapely.box(0, 0, 1, 1), shapely.box(0, 0, 2, 2)
    assert areas([small, large]) == [1.0, 4.0]
    assert areas([large, shapely.box(0, 0, 2, 2), small]) == [4.0, 4.0, 1.0]
    assert areas([]) == []
    assert areas([small, small]) == [1.0, 1.0]
    assert asked == [2, 0, 0, 1]
