from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Vector3(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Taxels(_message.Message):
    __slots__ = ("arrival_ns", "sample_ns", "counter", "counts", "device_ns")
    ARRIVAL_NS_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_NS_FIELD_NUMBER: _ClassVar[int]
    COUNTER_FIELD_NUMBER: _ClassVar[int]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    DEVICE_NS_FIELD_NUMBER: _ClassVar[int]
    arrival_ns: int
    sample_ns: int
    counter: int
    counts: _containers.RepeatedScalarFieldContainer[float]
    device_ns: int
    def __init__(self, arrival_ns: _Optional[int] = ..., sample_ns: _Optional[int] = ..., counter: _Optional[int] = ..., counts: _Optional[_Iterable[float]] = ..., device_ns: _Optional[int] = ...) -> None: ...

class CncStatus(_message.Message):
    __slots__ = ("sent_ns", "arrival_ns", "state", "position", "feed")
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    ARRIVAL_NS_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    FEED_FIELD_NUMBER: _ClassVar[int]
    sent_ns: int
    arrival_ns: int
    state: str
    position: Vector3
    feed: float
    def __init__(self, sent_ns: _Optional[int] = ..., arrival_ns: _Optional[int] = ..., state: _Optional[str] = ..., position: _Optional[_Union[Vector3, _Mapping]] = ..., feed: _Optional[float] = ...) -> None: ...

class Motion(_message.Message):
    __slots__ = ("line", "sent_ns", "acknowledged_ns", "phase", "start", "target", "speed", "dwell")
    LINE_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_NS_FIELD_NUMBER: _ClassVar[int]
    PHASE_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    DWELL_FIELD_NUMBER: _ClassVar[int]
    line: str
    sent_ns: int
    acknowledged_ns: int
    phase: str
    start: Vector3
    target: Vector3
    speed: float
    dwell: float
    def __init__(self, line: _Optional[str] = ..., sent_ns: _Optional[int] = ..., acknowledged_ns: _Optional[int] = ..., phase: _Optional[str] = ..., start: _Optional[_Union[Vector3, _Mapping]] = ..., target: _Optional[_Union[Vector3, _Mapping]] = ..., speed: _Optional[float] = ..., dwell: _Optional[float] = ...) -> None: ...

class Phase(_message.Message):
    __slots__ = ("name", "start_ns")
    NAME_FIELD_NUMBER: _ClassVar[int]
    START_NS_FIELD_NUMBER: _ClassVar[int]
    name: str
    start_ns: int
    def __init__(self, name: _Optional[str] = ..., start_ns: _Optional[int] = ...) -> None: ...

class ImageTime(_message.Message):
    __slots__ = ("arrival_ns", "sample_ns", "sequence", "device_ns")
    ARRIVAL_NS_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_NS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    DEVICE_NS_FIELD_NUMBER: _ClassVar[int]
    arrival_ns: int
    sample_ns: int
    sequence: int
    device_ns: int
    def __init__(self, arrival_ns: _Optional[int] = ..., sample_ns: _Optional[int] = ..., sequence: _Optional[int] = ..., device_ns: _Optional[int] = ...) -> None: ...

class CubeView(_message.Message):
    __slots__ = ("arrival_ns", "sample_ns", "sequence", "faces", "reprojection", "ids", "ambiguous", "covariance", "strays")
    ARRIVAL_NS_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_NS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FACES_FIELD_NUMBER: _ClassVar[int]
    REPROJECTION_FIELD_NUMBER: _ClassVar[int]
    IDS_FIELD_NUMBER: _ClassVar[int]
    AMBIGUOUS_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    STRAYS_FIELD_NUMBER: _ClassVar[int]
    arrival_ns: int
    sample_ns: int
    sequence: int
    faces: int
    reprojection: float
    ids: _containers.RepeatedScalarFieldContainer[int]
    ambiguous: bool
    covariance: _containers.RepeatedScalarFieldContainer[float]
    strays: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, arrival_ns: _Optional[int] = ..., sample_ns: _Optional[int] = ..., sequence: _Optional[int] = ..., faces: _Optional[int] = ..., reprojection: _Optional[float] = ..., ids: _Optional[_Iterable[int]] = ..., ambiguous: _Optional[bool] = ..., covariance: _Optional[_Iterable[float]] = ..., strays: _Optional[_Iterable[int]] = ...) -> None: ...

class Measured(_message.Message):
    __slots__ = ("arrival_ns", "sample_ns", "values")
    ARRIVAL_NS_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_NS_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    arrival_ns: int
    sample_ns: int
    values: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, arrival_ns: _Optional[int] = ..., sample_ns: _Optional[int] = ..., values: _Optional[_Iterable[float]] = ...) -> None: ...
