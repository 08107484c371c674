"""Lines of CARMEN logs."""


def robot_laser(stamp, x, readings):
    values = " ".join(str(reading) for reading in readings)
    poses = f"{x} 0 0.5 {x - 0.04} 0 0.5"
    laser = f"ROBOTLASER1 0 -1.5 3.0 1.5 50.0 0.1 0 {len(readings)} {values} 0"
    return f"{laser} {poses} 0 0 0 0 0 {stamp} host 1.0\n"


def front_laser(stamp, x, readings):
    values = " ".join(str(reading) for reading in readings)
    return f"FLASER {len(readings)} {values} {x} 0 0.5 {x} 0 0.5 {stamp} host {stamp}\n"
