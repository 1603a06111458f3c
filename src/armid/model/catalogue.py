"""The plants and effects there are."""

from armid.model.effect import Effect
from armid.model.effects.added_inertia import added_inertia
from armid.model.effects.asymmetric_viscous import asymmetric_viscous
from armid.model.effects.brush_drop import brush_drop
from armid.model.effects.controller_delay import controller_delay
from armid.model.effects.coulomb import coulomb
from armid.model.effects.drive_gain import drive_gain
from armid.model.effects.drive_lag import drive_lag
from armid.model.effects.drive_saturation import drive_saturation
from armid.model.effects.flux_saturation import flux_saturation
from armid.model.effects.gas_heat_loss import gas_heat_loss
from armid.model.effects.gravity_gain import gravity_gain
from armid.model.effects.gyro_bias import gyro_bias
from armid.model.effects.gyro_lag import gyro_lag
from armid.model.effects.gyro_scale import gyro_scale
from armid.model.effects.line_loss import line_loss
from armid.model.effects.load_friction import load_friction
from armid.model.effects.output_lag import output_lag
from armid.model.effects.position_gain import position_gain
from armid.model.effects.position_spring import position_spring
from armid.model.effects.presliding import presliding
from armid.model.effects.quadratic_drag import quadratic_drag
from armid.model.effects.seal_friction import seal_friction
from armid.model.effects.shell_rocking import shell_rocking
from armid.model.effects.stribeck import stribeck
from armid.model.effects.supply_error import supply_error
from armid.model.effects.supply_sag import supply_sag
from armid.model.effects.tachometer_lag import tachometer_lag
from armid.model.effects.tachometer_offset import tachometer_offset
from armid.model.effects.tachometer_ripple import tachometer_ripple
from armid.model.effects.tilt import tilt
from armid.model.effects.torque_offset import torque_offset
from armid.model.effects.torque_ripple import torque_ripple
from armid.model.effects.viscous import viscous
from armid.model.effects.winding_heating import winding_heating
from armid.model.effects.worm_direction import worm_direction
from armid.model.effects.worm_speed import worm_speed
from armid.model.plant import Plant
from armid.model.plants.driven_axis import driven_axis
from armid.model.plants.shell_transfer_arm import shell_transfer_arm

PLANTS: dict[str, Plant] = {p.name: p for p in (shell_transfer_arm, driven_axis)}
EFFECTS: dict[str, Effect] = {
    e.name: e
    for e in (
        # friction and other efforts on the shaft
        coulomb, stribeck, viscous, asymmetric_viscous, quadratic_drag, load_friction, presliding,
        seal_friction, torque_offset, torque_ripple, position_spring,
        # bodies and gravity
        shell_rocking, tilt, gravity_gain, added_inertia,
        # drive and gear
        drive_gain, drive_lag, drive_saturation, worm_direction, worm_speed,
        # motor and supply
        flux_saturation, brush_drop, winding_heating, supply_sag, supply_error,
        # balance machine
        gas_heat_loss, line_loss,
        # control
        tachometer_lag, tachometer_offset, tachometer_ripple, controller_delay, position_gain,
        # what is recorded
        gyro_lag, gyro_bias, gyro_scale, output_lag,
    )
}  # fmt: skip
