"""Run by the Python of QGIS: open layers as dragging them into its window does, and draw them."""

import json
import os
import sys

os.environ["QT_QPA_PLATFORM"] = "offscreen"

from qgis.core import QgsApplication, QgsMapRendererParallelJob, QgsMapSettings, QgsUnitTypes, QgsVectorLayer
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor

ORDER = ("rooms", "unseen", "walls", "doorways")
folder, stem, picture, width_px = sys.argv[1:]
application = QgsApplication([], False)
application.initQgis()
layers = [QgsVectorLayer(f"{folder}/{stem}.{name}.geojson", name, "ogr") for name in ORDER]
settings = QgsMapSettings()
settings.setLayers(layers[::-1])
settings.setBackgroundColor(QColor("white"))
settings.setDestinationCrs(layers[0].crs())
extent = layers[0].extent()
extent.scale(1.05)
height_px = round(int(width_px) * extent.height() / extent.width())
settings.setOutputSize(QSize(int(width_px), height_px))
settings.setExtent(extent)
job = QgsMapRendererParallelJob(settings)
job.start()
job.waitForFinished()
assert job.renderedImage().save(picture)
told = {
    layer.name(): {
        "unit": QgsUnitTypes.toString(layer.crs().mapUnits()),
        "labels": layer.labelsEnabled(),
        "area": sum(feature.geometry().area() for feature in layer.getFeatures()),
    }
    for layer in layers
}
print(json.dumps({"layers": told, "px_per_m": int(width_px) / extent.width()}), flush=True)
# Without taking QGIS down: it stumbles over objects that Python still holds.
os._exit(0)
